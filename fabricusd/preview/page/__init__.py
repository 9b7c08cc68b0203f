"""The page: shaders, script and style, and what puts them and a fabric into one HTML file."""

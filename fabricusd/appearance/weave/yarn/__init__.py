"""Yarn as it is spun: uneven threads as a map of the weave's coordinates, and shades along them."""

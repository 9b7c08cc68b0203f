"""Build networks of shading nodes for each surface model."""

"""Networks of shading nodes."""

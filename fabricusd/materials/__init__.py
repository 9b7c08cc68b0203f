"""Convert baked fabrics to materials for other tools: USD, MaterialX, U3M, OSL and Blender."""

"""Baked fabrics for other tools: USD looks, MaterialX documents, U3M, OSL, Blender."""

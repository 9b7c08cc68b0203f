"""Textures of a fabric on a garment, with a statement of how far they are from the truth."""

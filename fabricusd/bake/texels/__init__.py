"""Compute the values of texels: moments of the weave, maps made from them, and their encodings."""

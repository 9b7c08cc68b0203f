"""Lay out what is baked: garments, UVs, UDIM tiles and tangents."""

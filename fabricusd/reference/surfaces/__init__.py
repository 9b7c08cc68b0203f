"""Shading of the surfaces that paths hit: cloth and UsdPreviewSurface materials."""

"""Fit the surface models of other renderers to a fabric."""

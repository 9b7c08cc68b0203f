"""Scattering of one thread."""

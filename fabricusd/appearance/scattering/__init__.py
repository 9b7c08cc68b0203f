"""Scattering models of a single thread."""

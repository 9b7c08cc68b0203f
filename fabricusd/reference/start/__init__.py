"""Compiling or loading kernels ahead of the first picture."""

"""Compiling and loading kernels before the first picture."""

"""Rays: cameras, packets, random numbers, Embree, and the triangles that rays hit."""

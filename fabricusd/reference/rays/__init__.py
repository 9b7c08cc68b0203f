"""Rays: cameras, packets, random numbers, Embree, the triangles they meet."""

"""Columns of the tables of nodes that the kernels of the published laws read."""

from __future__ import annotations

NODE_COS, NODE_SIN, NODE_WEIGHT, NODE_HALF = 0, 1, 2, 3
"""Columns of `SurfaceTables.nodes`: cosine and sine of the tangent angle, share of the cloth's
area, and half the range of angles [rad] over which the node's lobes are averaged."""

"""Figured weaves: artwork whose regions, told by their colours, have weaves of their own."""

from __future__ import annotations

from fabricusd.weaves.figure.figure import Figure, read_figure

__all__ = ["Figure", "read_figure"]

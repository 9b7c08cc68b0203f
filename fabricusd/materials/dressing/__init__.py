"""Dressing: garments of mesh or USD files in a fabric, in a studio, as a scene to render."""

from __future__ import annotations

from fabricusd.materials.dressing.dress import Dressed, dress

__all__ = ["Dressed", "dress"]

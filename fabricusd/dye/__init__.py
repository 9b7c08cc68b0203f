"""From the colour of cloth to the albedo of its threads, and back."""

from __future__ import annotations

from fabricusd.dye.solve import Dyed, cloth_color, dyed, reached

__all__ = ["Dyed", "cloth_color", "dyed", "reached"]

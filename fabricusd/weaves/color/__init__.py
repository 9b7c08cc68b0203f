"""Colours as people write them, as display codes, and as the linear light of threads."""

from __future__ import annotations

from fabricusd.weaves.color.codes import (
    LONGEST_ORDER,
    codes_from_palette,
    color_order,
    describe_code,
    palette_from_codes,
    parse_color,
)
from fabricusd.weaves.color.notation import RGB

__all__ = [
    "LONGEST_ORDER",
    "RGB",
    "codes_from_palette",
    "color_order",
    "describe_code",
    "palette_from_codes",
    "parse_color",
]

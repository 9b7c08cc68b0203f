"""Weaves read from a name, an expression, an image or a WIF draft."""

from __future__ import annotations

from fabricusd.weaves.color import parse_color
from fabricusd.weaves.convert import DEFAULT_THREAD, from_fabric, losses, to_fabric
from fabricusd.weaves.draft import Draft, with_colors
from fabricusd.weaves.drawdown import draw
from fabricusd.weaves.image.read import read_image
from fabricusd.weaves.parse import parse_weave
from fabricusd.weaves.wif.read import parse_wif, read_wif
from fabricusd.weaves.wif.write import wif_text, write_wif

__all__ = [
    "DEFAULT_THREAD",
    "Draft",
    "draw",
    "from_fabric",
    "losses",
    "parse_color",
    "parse_weave",
    "parse_wif",
    "read_image",
    "read_wif",
    "to_fabric",
    "wif_text",
    "with_colors",
    "write_wif",
]

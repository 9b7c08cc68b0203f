"""Changing fabrics in their layers: attributes by name, or by the words of the trade."""

from __future__ import annotations

from fabricusd.schema.edit.edit import Change, parse_change, set_values
from fabricusd.schema.edit.words import WORDS

__all__ = ["WORDS", "Change", "parse_change", "set_values"]

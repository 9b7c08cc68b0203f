"""Parsing of weaves that are written on a command line."""

from __future__ import annotations

import re

from fabricusd.errors import FabricError, did_you_mean
from fabricusd.weaves.draft import Draft, quoted
from fabricusd.weaves.expression import parse_expression
from fabricusd.weaves.knits import knitted
from fabricusd.weaves.named import WEAVES, forms, parse_named


def parse_weave(text: str) -> Draft:
    """The draft of a named weave (`twill 2/1 S`) or of an expression (`mod(2*i + j, 5) != 0`).

    Raises FabricError for anything else.
    """
    words = text.lower().split()
    if words and words[0] in WEAVES:
        return parse_named(text)
    if re.search(r"[()<>=%]", text):
        return parse_expression(text)
    # A rib is a weave too.
    if "rib" not in words and (knit := knitted(text)):
        raise FabricError(f"weave {quoted(text)}", knit)
    hint = did_you_mean(words[0], WEAVES) if words else ""
    raise FabricError(
        f"weave {quoted(text)}",
        f"is not known{hint}; it must be one of {forms()}, or an expression such as "
        "mod(2*i + j, 5) != 0",
    )

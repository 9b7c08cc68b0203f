"""Cloths that people ask for by name and that are knitted: no weave makes them."""

from __future__ import annotations

import re

KNITS = {
    "jersey": "cotton_poplin",
    "interlock": "cotton_poplin",
    "rib": "cotton_poplin",
    "pique": "oxford",
    "ponte": "gabardine",
    "fleece": "wool_flannel",
    "sweatshirt": "wool_flannel",
    "french terry": "wool_flannel",
    "tricot": "viscose_lining",
    "milanese": "viscose_lining",
    "raschel": "gauze",
    "crochet": "gauze",
    "tulle": "organza",
    "knit": "cotton_poplin",
    "knitted": "cotton_poplin",
    "knitwear": "wool_flannel",
}
"""Name -> the woven preset that is nearest in fibre and weight."""


def knitted(name: str) -> str:
    """What to say of a cloth that is asked for by a name of a knit; "" of any other name."""
    words = " ".join(re.findall(r"[a-z]+", name.lower().replace("é", "e")))
    for knit, near in KNITS.items():
        if re.search(rf"\b{knit}s?\b", words):
            return f"is knitted, not woven; a woven preset that is near is '{near}'"
    return ""

"""WIF drafts for tests, and a slow reading of them."""

from __future__ import annotations

import numpy as np

TWILL = """[WIF]
Version=1.1
Date=April 20, 1997
Developers=somebody
Source Program=a test
[CONTENTS]
COLOR PALETTE=true
[TEXT]
Title=Twill; two over two
Author=A. Weaver
[NOTES]
2=second line
1=first line; with a semicolon
[COLOR PALETTE]
Entries=2
Form=RGB
Range=0,255
[COLOR TABLE]
1=0,0,0
2=255,255,255
[WEAVING]
Shafts=4
Treadles=4
Rising Shed=true
[WARP]
Threads=4
Color=1
Units=Centimeters
Spacing=0.05
Thickness=0.04
[WEFT]
Threads=5
Color=2
Units=Centimeters
Spacing=0.1
Thickness=0.08
[THREADING]
1=1
2=2
3=3
4=4
[TIEUP]
1=1,2
2=2,3
3=3,4
4=1,4
[TREADLING]
1=1
2=2
3=3
4=4
5=1
"""
TWILL_CELLS = np.array([[1, 0, 0, 1, 1], [1, 1, 0, 0, 1], [0, 1, 1, 0, 0], [0, 0, 1, 1, 0]], bool)


def changed(*changes: tuple[str, str]) -> str:
    """TWILL with parts replaced; each must be there."""
    text = TWILL
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def plain_ini(text: str) -> dict[str, dict[str, str]]:
    """A reading of tidy WIF that shares nothing with the package's."""
    sections: dict[str, dict[str, str]] = {}
    for line in text.splitlines():
        if line.startswith("["):
            current = sections.setdefault(line.strip("[]").upper(), {})
        elif "=" in line:
            key, value = line.split("=", 1)
            current[key.lower()] = value
    return sections


def slow_cells(text: str) -> np.ndarray:
    """(ends, picks) bool of a tidy rising-shed draft, crossing by crossing."""
    wif = plain_ini(text)
    ends, picks = int(wif["WARP"]["threads"]), int(wif["WEFT"]["threads"])
    cells = np.zeros((ends, picks), bool)
    for i in range(ends):
        shafts = set(wif["THREADING"][str(i + 1)].split(","))
        for j in range(picks):
            if "TIEUP" in wif:
                treadles = wif["TREADLING"][str(j + 1)].split(",")
                lifted = {s for t in treadles for s in wif["TIEUP"].get(t, "").split(",")}
            else:
                lifted = set(wif["LIFTPLAN"][str(j + 1)].split(","))
            cells[i, j] = bool((shafts - {"0", ""}) & lifted)
    return cells


SMALL = """[WIF]
Version=1.1
[WEAVING]
Shafts=2
Treadles=2
Rising Shed=true
[COLOR PALETTE]
Form=RGB
Range=0,255
[COLOR TABLE]
1=0,0,0
2=255,255,255
[WARP]
Threads=2
Color=1
Units=Inches
Spacing=0.05
[WEFT]
Threads=2
Color=2
[THREADING]
1=1
2=2
[TIEUP]
1=1
2=2
[TREADLING]
1=1
2=2
[WARP COLORS]
1=1
"""

"""The scale of a map of differences: which color stands for which number, below the map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.images.labels import labelled
from fabricusd.quality.pictures import heat

TICKS = (0.0, 0.25, 0.5, 0.75, 1.0)
LEAST = 240
"""Width [pixels] in which the numbers of the ticks do not touch."""

MARGIN, BAR, STRIP, TEXT = 10, 12, 52, 13
"""Around the bar; heights of the bar, of the strip below the map, and of the text [pixels]."""

GROUND, INK = 255, 30
"""Greys of the strip and of its text."""


def with_scale(values: NDArray[np.float64], title: str) -> NDArray[np.uint8]:
    """(h, w) values from 0 to 1 -> (h + STRIP, max(w, LEAST), 3) uint8: the map above its scale.

    A map narrower than the scale stands in its middle.
    """
    shown = heat(values)
    height, width = shown.shape[:2]
    wide = max(width, LEAST)
    whole = np.full((height + STRIP, wide, 3), GROUND, np.uint8)
    left = (wide - width) // 2
    whole[:height, left : left + width] = shown
    top = height + MARGIN
    bar = np.linspace(0.0, 1.0, min(wide, 4 * LEAST) - 2 * MARGIN)
    whole[top - 1 : top + BAR + 1, MARGIN - 1 : MARGIN + len(bar) + 1] = INK
    whole[top : top + BAR, MARGIN : MARGIN + len(bar)] = heat(bar[None])
    line = top + BAR + TEXT + 3
    labels = []
    for tick in TICKS:
        x = MARGIN + round(tick * (len(bar) - 1))
        whole[top + BAR : top + BAR + 4, x] = INK
        # The outer numbers stay above the bar; half a digit is about a quarter of the size.
        text = f"{tick:g}"
        shift = {0.0: 0, 1.0: -TEXT // 2}.get(tick, -TEXT * len(text) // 4)
        labels.append((x + shift, line, text))
    labels.append((MARGIN, line + TEXT, title))
    try:
        return labelled(whole, labels, TEXT, INK)
    except FabricError:
        # Without a font, the ticks stand alone.
        return whole

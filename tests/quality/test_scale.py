"""The scale below a map of differences."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.quality.pictures import heat
from fabricusd.quality.scale import GROUND, LEAST, MARGIN, STRIP, with_scale


@pytest.mark.parametrize("width", [3, LEAST, 700])
def test_the_map_stands_above_a_bar_of_its_colors(width):
    values = np.linspace(0, 1, 5 * width).reshape(5, width)
    made = with_scale(values, "FLIP")
    wide = max(width, LEAST)
    assert made.shape == (5 + STRIP, wide, 3)
    left = (wide - width) // 2
    assert (made[:5, left : left + width] == heat(values)).all()
    bar = made[5 + MARGIN + 2, MARGIN : wide - MARGIN]
    assert tuple(bar[0]) == (0, 0, 0)
    assert tuple(bar[-1]) == (255, 255, 255)
    middle = heat(np.array([[0.5]]))[0, 0].astype(int)
    assert np.abs(bar[len(bar) // 2].astype(int) - middle).max() <= 3


def test_the_scale_has_numbers():
    made = with_scale(np.zeros((4, LEAST)), "FLIP")
    text = made[4 + MARGIN + 17 :, :, 0]
    for share in (0.0, 0.5, 1.0):
        x = MARGIN + round(share * (LEAST - 2 * MARGIN - 1))
        assert (text[:, max(x - 9, 0) : x + 9] < GROUND).any()

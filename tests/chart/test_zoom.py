"""Moiré and blur as numbers, on signals whose alias and blur are known."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.footprint import FAR, weights
from fabricusd.chart.cloth_picture import SIZE, difference, ideal_spectrum, picture, view_of
from fabricusd.fabric import even
from fabricusd.schema import load, published_names
from tests.appearance.presets import often


def waves(*parts: tuple[int, int, float]) -> np.ndarray:
    """A mean of 1 and cosines of (cycles along x, along y, amplitude), at pixel centres."""
    line = 2 * np.pi * (np.arange(SIZE) + 0.5) / SIZE
    y, x = np.meshgrid(line, line, indexing="ij")
    return np.ones_like(x) + sum(a * np.cos(kx * x + ky * y) for kx, ky, a in parts)


def spectrum(*parts: tuple[int, int, float]) -> np.ndarray:
    found = np.zeros((SIZE, SIZE), complex)
    found[0, 0] = 1.0
    for kx, ky, a in parts:
        found[ky, kx] += 0.5 * a
        found[-ky, -kx] += 0.5 * a
    return found


def test_a_faithful_picture_has_neither():
    assert difference(waves((3, 1, 0.4)), spectrum((3, 1, 0.4))).total < 1e-12


def test_a_weakened_wave_is_blur():
    found = difference(waves((3, 1, 0.1)), spectrum((3, 1, 0.4)))
    assert found.blur == pytest.approx(0.3 / np.sqrt(2))
    assert found.alias < 1e-9


def test_a_wave_that_is_not_there_is_alias():
    found = difference(waves((3, 1, 0.4), (5, 0, 0.2)), spectrum((3, 1, 0.4)))
    assert found.alias == pytest.approx(0.2 / np.sqrt(2))
    assert found.blur < 1e-9


def test_a_brighter_picture_is_shifted():
    found = difference(waves() * 1.1, spectrum())
    assert (found.alias, found.blur) == pytest.approx((0, 0), abs=1e-9)
    assert found.shift == pytest.approx(0.1)


def test_points_of_a_fine_weave_are_all_moire_and_many_points_hardly():
    view = view_of(even(load("linen_plain")), 3.0)
    ideal = ideal_spectrum(view)
    point, many = (difference(picture(view, "weave", n), ideal) for n in (1, 8))
    assert view.threads_per_pixel == pytest.approx(3.0, rel=0.02)
    assert point.alias > 0.5
    assert many.alias < 0.2 * point.alias


def test_a_close_view_is_nearly_its_spectrum():
    """The spectrum is taken from the repeat, the picture from the view: they must agree."""
    view = view_of(even(load("silk_crepe_de_chine")), 0.1)
    found = difference(picture(view, "weave", 4), ideal_spectrum(view))
    contrast = np.sqrt((np.abs(ideal_spectrum(view)) ** 2).sum()) / abs(ideal_spectrum(view)[0, 0])
    assert found.total < 0.3 * contrast
    turned = ideal_spectrum(view).T
    assert difference(picture(view, "weave", 4), turned).total > 0.5 * contrast


@pytest.mark.parametrize("name", often(published_names()))
def test_auto_shows_of_a_repeat_what_a_picture_can_hold(name):
    """All of it from four pixels a repeat on; below two no moire, and nothing that is missing."""
    fabric = even(load(name))
    repeat = max(true_repeat(fabric))
    assert weights(fabric, [[repeat / 4.0] * 2])[0, FAR] == 0.0
    view = view_of(fabric, repeat / 1.8)
    far, weave = picture(view, "far", 1), picture(view, "weave", 4)
    share = weights(fabric, [[view.threads_per_pixel] * 2])[0, FAR]
    ideal = ideal_spectrum(view)
    auto, woven = (difference(p, ideal) for p in (share * far + (1 - share) * weave, weave))
    assert auto.alias < 0.1 * woven.alias
    assert auto.blur < woven.blur + 0.01

"""Tiles of a fabric repeat."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.materials.targets.tile import THREADS, baked_tile, even
from fabricusd.schema import load
from tests.appearance.presets import often

CLOTHS = ("linen_plain", "polyester_satin_charmeuse", "cotton_poplin", "denim")


def across_border(pixels):
    """Mean difference of texels across the tile's borders, over the most between lines inside."""
    found = []
    for axis in (0, 1):
        border = np.abs(np.take(pixels, 0, axis) - np.take(pixels, -1, axis)).mean()
        inside = np.abs(np.diff(pixels, axis=axis)).mean(axis=(1 - axis, 2))
        found.append(border / max(inside.max(), 1e-9))
    return max(found)


@pytest.mark.parametrize("name", often(CLOTHS, ("denim",)))
def test_texels_across_the_border_differ_as_neighbours_inside_do(name):
    tile = baked_tile(load(name), resolution=256, level="thread")
    assert tile.ends >= THREADS
    for key in ("base_color", "height", "opacity", "normal", "roughness_along"):
        assert across_border(tile.maps[key]) <= 1.05, key


@pytest.mark.exhaustive
def test_the_measure_tells_a_tile_of_uneven_yarn_from_one_that_repeats(monkeypatch):
    monkeypatch.setattr("fabricusd.materials.targets.tile.even", lambda cloth: cloth)
    tile = baked_tile(load("denim"), resolution=256, level="thread")
    assert across_border(tile.maps["height"]) > 1.2


def test_even_threads_keep_all_but_their_unevenness():
    fabric = load("linen_plain")
    assert fabric.is_uneven
    assert not even(fabric).is_uneven
    back = replace(fabric, back=None)
    assert not even(replace(fabric, back=back)).back.is_uneven
    for one, other in zip(fabric.thread_list, even(fabric).thread_list, strict=True):
        assert (one.albedo, one.thickness, one.model) == (
            other.albedo,
            other.thickness,
            other.model,
        )

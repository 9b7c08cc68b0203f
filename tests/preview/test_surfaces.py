"""Where samples of a pixel look up the weave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.preview.fabrics import fabric_of
from fabricusd.preview.lights import Lights
from fabricusd.preview.picture import _extent
from fabricusd.preview.surfaces import Cloth, Seen
from fabricusd.preview.tables import tables_of


def pixels_of(extent: float, count: int = 4096) -> Seen:
    """Pixels that see cloth from straight above, at places that are all the same in its repeat."""
    up = np.tile(np.array([[0.0], [0.0], [1.0]], np.float32), (1, count))
    threads = np.full((count, 2), extent, np.float32)
    return Seen(up, up, up, np.full((count, 2), 7.25), *np.ones((2, count), np.float32), threads)


def spread(seen: Seen) -> float:
    """Standard deviation over mean of what the pixels show, in the channel that shows most."""
    cloth, rng = Cloth(tables_of(fabric_of("denim")[0])), np.random.default_rng(0)
    numbers = rng.random((4, len(seen.uv)), np.float32)
    value = cloth.radiance(seen, Lights(zenith=0.0, nadir=0.0), "weave", numbers)
    return float((value.std(axis=1) / value.mean(axis=1)).max())


def test_where_a_pixel_holds_many_repeats_a_sample_is_anywhere_in_one():
    assert spread(pixels_of(100.0)) > 0.5
    assert spread(pixels_of(1.0)) == pytest.approx(0.0, abs=1e-6)
    both = replace(pixels_of(100.0), extent=np.tile(np.array([100, 1], np.float32), (4096, 1)))
    assert spread(both) == pytest.approx(0.0, abs=1e-6)


def test_a_sample_stays_within_half_a_repeat():
    seen, rng = pixels_of(100.0), np.random.default_rng(1)
    seen = replace(seen, uv=rng.uniform(-1e6, 1e6, seen.uv.shape))
    cloth = Cloth(tables_of(fabric_of("denim")[0]))
    moved = cloth._even(seen, rng.random((2, len(seen.uv)), np.float32)) - seen.uv
    repeat = cloth.tables.cloth.grid.shape
    assert np.all(np.abs(moved) <= np.array(repeat) / 2 + 1e-6)
    assert np.all(np.abs(moved).max(axis=0) > 0.49 * np.array(repeat))


def test_the_extent_of_a_pixel_is_its_neighbours_distance_but_not_over_a_seam():
    rows, columns = np.indices((3, 6))
    uv = np.stack((3.0 * columns + rows, 2.0 * rows + 1e7), axis=-1)
    uv[:, 3:] += 1000.0  # a seam
    pixels = np.flatnonzero((columns < 5).ravel())  # nothing is seen in the last column
    found = _extent(uv.reshape(-1, 2)[pixels], pixels, (6, 3)).reshape(3, 6, 2)
    assert np.array_equal(found[:, :5], np.broadcast_to([4.0, 2.0], (3, 5, 2)))
    assert not found[:, 5].any()

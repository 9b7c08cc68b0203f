"""Coverage of texels by a UV layout."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fabricusd.bake.layout.raster import NOBODY, owners, times_covered

corner = st.tuples(st.floats(0, 32, width=32), st.floats(0, 32, width=32))


def _touched(tri: np.ndarray, size: int) -> np.ndarray:
    """Brute force: texels whose square holds a point of a dense sampling of the triangle, and not
    on its border, where rounding decides which square it is in."""
    a, b = np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 201))
    inside = a + b <= 1
    a, b = a[inside], b[inside]
    points = tri[0] + a[:, None] * (tri[1] - tri[0]) + b[:, None] * (tri[2] - tri[0])
    points = points[(abs(points - np.round(points)) > 1e-9).all(axis=1)]
    found = np.zeros((size, size), bool)
    cell = np.clip(np.floor(points).astype(int), 0, size - 1)
    found[cell[:, 1], cell[:, 0]] = True
    return found


@given(st.tuples(corner, corner, corner))
@example(((0.0, 0.0), (0.0, 3.0), (1.0, 0.0)))
def test_every_texel_that_a_triangle_touches_is_covered(points):
    tri = np.array(points)
    owner, touched = owners(tri[None], np.zeros(1, np.int32), (0, 0, 32, 32), 0, 32)
    assert (touched | ~_touched(tri, 32)).all()
    assert ((owner == 0) == touched).all()


def test_nothing_far_from_the_triangle_is_covered():
    tri = np.array([[4.2, 4.2], [9.7, 4.9], [5.1, 9.9]])
    _, touched = owners(tri[None], np.zeros(1, np.int32), (0, 0, 32, 32), 0, 32)
    near = _touched(tri, 32)
    grown = np.zeros_like(near)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            grown |= np.roll(near, (dy, dx), (0, 1))
    assert (grown | ~touched).all()


def test_a_margin_continues_the_owner_and_stops():
    tri = np.array([[10.0, 10.0], [20.0, 10.0], [10.0, 20.0]])
    owner, touched = owners(tri[None], np.full(1, 3, np.int32), (0, 0, 64, 64), 5, 64)
    _, x = np.nonzero(owner != NOBODY)
    assert set(np.unique(owner)) == {NOBODY, 3}
    assert (owner == 3).sum() > touched.sum()
    assert x.min() == 9 - 5 or x.min() == 10 - 5
    assert owner[40, 40] == NOBODY


def test_a_block_and_the_whole_agree_on_who_owns_a_texel():
    rng = np.random.default_rng(0)
    tri = rng.random((20, 1, 2)) * 100 + rng.random((20, 3, 2)) * 25
    values = np.arange(20, dtype=np.int32)
    whole, _ = owners(tri, values, (0, 0, 128, 128), 0, 128)
    part, _ = owners(tri, values, (32, 64, 64, 96), 0, 128)
    assert np.array_equal(whole[64:96, 32:64], part)


@pytest.mark.parametrize(
    ("second", "overlaps"),
    [
        ([[20, 4], [4, 20], [20, 20]], False),
        ([[4, 4], [20, 4], [4, 20]], True),
        ([[16, 4], [4, 20], [20, 20]], True),
    ],
)
def test_triangles_with_a_common_edge_do_not_overlap_and_others_do(second, overlaps):
    tri = np.array([[[4, 4], [20, 4], [4, 20]], second], float)
    count, pairs = times_covered(tri, (32, 32))
    assert bool((count > 1).any()) == overlaps
    assert bool(len(pairs)) == overlaps

"""The numbers of the path tracer: a known sequence, even in every cell, and worth their name."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit
from scipy.stats import kstest, qmc

from fabricusd.kernels.real import LEAN
from fabricusd.reference.rays.sobol import (
    four_numbers,
    new_numbers,
    reverse_bits,
    sobol_reversed,
)
from fabricusd.scene.light_kinds import RECT
from fabricusd.scene.scene import Camera, Light
from tests.reference.scenes import grid, lambert, looking, picture


@njit(**LEAN)
def _plain(out):
    for k in range(out.shape[1]):
        a, b, c, d = sobol_reversed(np.uint32(k))
        out[0, k], out[1, k] = reverse_bits(a), reverse_bits(b)
        out[2, k], out[3, k] = reverse_bits(c), reverse_bits(d)


@njit(**LEAN)
def _drawn(numbers, pixel, place, out):
    for k in range(out.shape[1]):
        out[0, k], out[1, k], out[2, k], out[3, k] = four_numbers(
            numbers, np.uint32(pixel), np.uint32(k), np.uint32(place)
        )


def drawn(count, *, pixel=0, place=0, seed=0, independent=False):
    out = np.empty((4, count), np.float32)
    _drawn(new_numbers(seed, independent=independent), pixel, place, out)
    return out


def test_without_scrambling_the_sequence_is_that_of_scipy():
    out = np.empty((4, 1 << 16), np.uint32)
    _plain(out)
    k = np.arange(1 << 16)
    # scipy walks through the sequence in the order of Gray's code.
    expected = qmc.Sobol(4, scramble=False, bits=32).random(1 << 16)
    assert np.array_equal(out[:, k ^ (k >> 1)].T / 2.0**32, expected)


def fullest(count, parts, **drawing):
    """The most points in any cell of each division of two dimensions into so many parts."""
    u = drawn(count, **drawing)[:2].astype(float)
    return [
        np.bincount(
            (u[0] * (1 << k)).astype(int) * (parts >> k) + (u[1] * (parts >> k)).astype(int)
        )
        for k in range(parts.bit_length())
    ]


@pytest.mark.parametrize("count", [4, 16, 64, 1024])
@pytest.mark.parametrize("place", [0, 7])
def test_each_cell_of_each_division_holds_one_point(count, place):
    for seed in range(3):
        cells = fullest(count, count, place=place, seed=seed, pixel=5)
        assert all((c == 1).all() for c in cells)


def test_independent_numbers_do_not_fill_the_cells_evenly():
    assert all(c.max() > 1 for c in fullest(64, 64, independent=True))


def test_numbers_are_uniform_and_pixels_places_and_seeds_have_their_own():
    first = np.concatenate([drawn(1, pixel=k) for k in range(2000)], axis=1)
    for row in first:
        assert kstest(row, "uniform").pvalue > 1e-4
    base = drawn(16)
    assert first.max() < 1.0
    for other in (drawn(16, pixel=1), drawn(16, place=1), drawn(16, seed=1)):
        assert not np.any(base == other)
    assert abs(np.corrcoef(first)[np.triu_indices(4, 1)]).max() < 4 / np.sqrt(2000)


def test_a_lamps_soft_shadow_has_a_third_of_the_variance_of_independent_numbers():
    lamp = Light(
        path="l", kind=RECT, radiance=(1, 1, 1), width=1.0, height=1.0,
        frame=looking((0.4, 1.0, 0.3)),
    )  # fmt: skip
    folds = grid(lambda x, z: 0.1 * np.sin(19 * x), cells=40)
    camera = Camera(frame=looking((0.7, 1.4, 1.0)), aperture=(0.03, 0.03))

    def beauty(**settings):
        r = picture([folds], [lambert(0.5)], [lamp], camera, max_bounces=0, **settings)
        return r.layers["beauty"][..., 0], r.layers["variance"][..., 0]

    exact, _ = beauty(spp=4096, seed=1)
    even, variance = beauty(spp=64)
    loose, _ = beauty(spp=64, sampler="random")
    error, other = ((p - exact) ** 2 for p in (even, loose))
    assert error.mean() < other.mean() / 3
    # What the picture says of itself is its error, and a little more.
    assert error.mean() < variance.mean() < 1.8 * error.mean()

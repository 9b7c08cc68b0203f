"""Whether the difference of two noisy pictures is larger than their noise explains."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.quality.statistics import z_test

Values = NDArray[np.floating]

BLOCK = 4
"""Pixels along the side of the squares whose means are tested. The radiance of a single pixel has
too long tails for a z-test; the mean of 16 is nearly normal."""

SIGNIFICANCE = 0.01
"""Share of pairs of pictures of the same expectation that the test calls different."""


@dataclass(frozen=True, kw_only=True)
class NoiseTest:
    """Outcome of a z-test of two pictures.

    larger : whether the difference is larger than the noise explains
    p : probability that noise alone makes a difference as large somewhere in the picture
    significance : the p below which the difference counts as larger
    pixel : (x, y) of the middle of the square that differs most, compared with its noise
    """

    larger: bool
    p: float
    significance: float
    pixel: tuple[int, int]


def noise_test(
    picture: Values,
    variance: Values,
    reference: Values,
    reference_variance: Values,
    significance: float = SIGNIFICANCE,
) -> NoiseTest:
    """The z-test of two (h, w, c) pictures, given the variance of each of their values.

    The variances are those of means, as in the layer `variance` of a render. Noise must be
    independent from pixel to pixel and between the pictures: render them with different seeds.
    Pixels that are not finite in every array are left out. Raises FabricError if the shapes differ,
    if no pixel is finite, or if a variance is negative.
    """
    arrays = [np.asarray(x, np.float64) for x in (picture, variance, reference, reference_variance)]
    if len({x.shape for x in arrays}) != 1 or arrays[0].ndim != 3:
        shapes = ", ".join(str(x.shape) for x in arrays)
        raise FabricError("pictures and variances", f"have shapes {shapes}; they must be equal")
    good = np.logical_and.reduce([np.isfinite(x).all(axis=2) for x in arrays])
    if not good.any():
        raise FabricError("pictures", "have no pixel that is finite in both, with its variance")
    a, va, b, vb = (np.where(good[..., None], x, 0.0) for x in arrays)
    if min(va.min(), vb.min()) < 0.0:
        worst = min(va.min(), vb.min())
        raise FabricError("variance", f"is {worst:g} somewhere; it must be at least 0")
    counts = _block_sums(good[..., None].astype(np.float64))
    some = counts[..., 0] > 0
    n = counts[some]
    mean, reference_mean = _block_sums(a)[some] / n, _block_sums(b)[some] / n
    of_mean, of_reference = _block_sums(va)[some] / n**2, _block_sums(vb)[some] / n**2
    same, smallest = z_test(mean, of_mean, reference_mean, of_reference, significance)
    tested = int(np.count_nonzero(of_mean + of_reference > 0.0))
    gap, spread = np.abs(mean - reference_mean), np.sqrt(of_mean + of_reference)
    # A difference without any noise is the largest there is.
    ratio = np.divide(gap, spread, out=np.where(gap > 0.0, np.inf, 0.0), where=spread > 0.0)
    row, column = np.argwhere(some)[int(ratio.max(axis=1).argmax())]
    height, width = good.shape
    return NoiseTest(
        larger=not same,
        # [Sidak1967]: of `tested` independent values, one is as unlikely as the smallest p.
        p=1.0 if smallest == 1.0 else -math.expm1(tested * math.log1p(-smallest)),
        significance=significance,
        pixel=(
            min(int(column) * BLOCK + BLOCK // 2, width - 1),
            min(int(row) * BLOCK + BLOCK // 2, height - 1),
        ),
    )


def _block_sums(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(h, w, c) -> (rows, columns, c) sums over squares; those at the right and bottom are cut."""
    rows, columns = (np.arange(0, size, BLOCK) for size in values.shape[:2])
    sums = np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)
    return np.asarray(sums)

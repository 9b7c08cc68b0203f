"""Whether chance explains a difference: the tests that golden pictures and samplers are held to."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from fabricusd.errors import FabricError


def z_test(
    mean: NDArray[np.floating],
    variance_of_mean: NDArray[np.floating],
    golden: NDArray[np.floating],
    golden_variance: NDArray[np.floating],
    significance: float = 0.01,
) -> tuple[bool, float]:
    """Do two noisy pictures show the same? (passes, smallest p-value of a pixel).

    Each is a mean with the variance of that mean, any equal shapes. Two-sided z per value; the
    significance is for the whole picture, shared out by [Sidak1967], so that a true pair fails once
    in 1/significance pictures whatever its size. Values that neither picture says vary are left out
    where they agree, and fail the picture where they do not.
    """
    spread = np.sqrt(np.asarray(variance_of_mean, np.float64) + golden_variance)
    gap = np.abs(np.asarray(mean, np.float64) - golden)
    if not (np.isfinite(spread).all() and np.isfinite(gap).all()):
        raise FabricError("pictures", "hold values that are not finite")
    exact = spread == 0.0
    if (gap[exact] > 1e-6 * np.maximum(np.abs(golden[exact]), 1.0)).any():
        return False, 0.0
    p = 2.0 * stats.norm.sf(gap[~exact] / spread[~exact])
    if p.size == 0:
        return True, 1.0
    smallest = float(p.min())
    threshold = -math.expm1(math.log1p(-significance) / p.size)
    return smallest > threshold, smallest


def chi_squared(
    counts: NDArray[np.integer], expected: NDArray[np.floating], least: float = 5.0
) -> tuple[float, float, int]:
    """(statistic, p-value, degrees of freedom) of sampled counts against what a density expects.

    Cells that expect fewer than `least` are pooled, so that the statistic follows its law; a count
    in a cell that expects nothing at all makes the p-value 0. [Pearson1900]
    """
    found = np.asarray(counts, np.float64).ravel()
    wanted = np.asarray(expected, np.float64).ravel()
    if found.shape != wanted.shape:
        raise FabricError("counts", f"are {found.size} and expected {wanted.size}; as many of each")
    if (found[wanted <= 0.0] > 0).any():
        return math.inf, 0.0, 0
    order = np.argsort(wanted)
    found, wanted = found[order], wanted[order]
    small = int(np.searchsorted(wanted, least))
    # Pool the smallest until together they expect enough.
    while small < wanted.size and wanted[:small].sum() < least and small > 0:
        small += 1
    if small:
        found = np.append(found[small:], found[:small].sum())
        wanted = np.append(wanted[small:], wanted[:small].sum())
    found, wanted = found[wanted > 0.0], wanted[wanted > 0.0]
    freedom = found.size - 1
    if freedom < 1:
        raise FabricError("expected", f"has {found.size} usable cells; it must have at least 2")
    statistic = float(((found - wanted) ** 2 / wanted).sum())
    return statistic, float(stats.chi2.sf(statistic, freedom)), freedom

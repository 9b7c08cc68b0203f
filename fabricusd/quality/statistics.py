"""Statistical tests of whether chance explains a difference between pictures or histograms."""

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
    """Whether two noisy pictures can have the same expectation: (passes, smallest p-value).

    Each picture is a mean with the variance of that mean, all of the same shape. The z-test of each
    value is two-sided. The significance holds for the picture as a whole and is divided among its
    values by [Sidak1967], so that of pairs with the same expectation one in 1/significance fails,
    whatever their size. Values without variance in either picture are left out if they agree, and
    fail the test if they do not.
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
    """(statistic, p-value, degrees of freedom) of sampled counts against the expected counts.

    Cells with an expectation below `least` are pooled, so that the statistic follows its law. A
    count in a cell whose expectation is 0 makes the p-value 0. [Pearson1900]
    """
    found = np.asarray(counts, np.float64).ravel()
    wanted = np.asarray(expected, np.float64).ravel()
    if found.shape != wanted.shape:
        raise FabricError(
            "counts", f"are {found.size}; there must be as many as expected counts, {wanted.size}"
        )
    if (found[wanted <= 0.0] > 0).any():
        return math.inf, 0.0, 0
    order = np.argsort(wanted)
    found, wanted = found[order], wanted[order]
    small = int(np.searchsorted(wanted, least))
    # Pool the smallest cells until their expectation is large enough.
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

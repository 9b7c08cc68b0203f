"""The camera's response: from codes to linear light, found from exposures of grey patches.

The objective is that of [Robertson1999]: all exposures of a patch agree on its radiance. Robertson
solves for one value a code, in turns with the radiances, and is left 4 to 6 % wrong by codes that
are rarely seen. Here the response is a cubic B-spline of 8 coefficients; the radiances are
eliminated, so the objective is quadratic and one linear solve finds the minimum.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from fabricusd.errors import FabricError

Floats = NDArray[np.float64]

COEFFICIENTS = 8
BRIGHTEST = 0.985
"""Share of the largest code above which a patch counts as saturated: its mean is clipped."""
DARKEST = 0.004
"""Share of the largest code above black below which a patch tells only noise."""
READ_NOISE = 0.002
"""Variance of a code at black, as a share of the largest code, in the weight 1/(READ_NOISE + c)."""
FEWEST = 4 * COEFFICIENTS


def linear_response(levels: int, black: float) -> Floats:
    """(levels + 1,) exposure of each code of a linear camera: 0 at black, 1 at half the range."""
    return np.asarray((np.arange(levels + 1) - black) / (0.5 * levels - black), np.float64)


def spline_response(means: Floats, times: Floats, levels: int, black: float) -> Floats:
    """(levels + 1,) exposure of each code: 0 at the code of black, 1 at half the range.

    means : (e, p) mean codes of p patches at e exposures; times : (e,) [s]

    Codes below black get negative exposures, with the slope at black, so that noise averages out.
    Raises FabricError if too few patches are neither dark nor saturated.
    """
    knots = np.linspace(black, levels, COEFFICIENTS - 2)
    knots = np.concatenate([knots[:1].repeat(3), knots, knots[-1:].repeat(3)])
    seconds = np.asarray(times, np.float64)[:, None]
    used = (means < BRIGHTEST * levels) & (means > black + DARKEST * levels)
    # A patch that one exposure alone shows says nothing of the response.
    used &= used.sum(axis=0) > 1
    if np.count_nonzero(used) < FEWEST:
        raise FabricError(
            "the chart",
            f"has {np.count_nonzero(used)} means of patches that are neither dark nor saturated; "
            f"there must be at least {FEWEST}",
        )
    code = np.clip(means, black, levels)
    basis = BSpline.design_matrix(code.ravel(), knots, 3).toarray()
    basis = basis.reshape(*code.shape, COEFFICIENTS)
    weight = used / (READ_NOISE * levels + np.maximum(code - black, 0.0))
    # The radiance of a patch, eq. 3.3 with the response still unknown: linear in the coefficients.
    norm = np.maximum((weight * seconds**2).sum(axis=0), 1e-30)
    radiance = (weight[..., None] * seconds[..., None] * basis).sum(axis=0) / norm[:, None]
    residual = np.sqrt(weight)[..., None] * (basis - seconds[..., None] * radiance)
    rows = residual.reshape(-1, COEFFICIENTS)
    held = BSpline.design_matrix(np.array([black, 0.5 * levels]), knots, 3).toarray()
    normal = np.block([[rows.T @ rows, held.T], [held, np.zeros((2, 2))]])
    wanted = np.concatenate([np.zeros(COEFFICIENTS), [0.0, 1.0]])
    found = np.linalg.lstsq(normal, wanted, rcond=None)[0][:COEFFICIENTS]
    spline = BSpline(knots, found, 3)
    codes = np.arange(levels + 1, dtype=np.float64)
    table = np.asarray(spline(np.clip(codes, black, levels)), np.float64)
    slope = float(spline.derivative()(black))
    if not slope > 0:
        raise FabricError("the chart", "gives a response that falls at black; check its exposures")
    return np.where(codes < black, slope * (codes - black), table)


def patch_means(frame: NDArray[np.float64], rows: int, columns: int) -> Floats:
    """(4 rows columns,) means of the inner half of each patch, for each site of the 2 x 2 filter.

    frame : (h, w) codes of the chart, whose patches fill it evenly
    """
    h, w = frame.shape
    means = []
    for site in range(4):
        plane = frame[site // 2 :: 2, site % 2 :: 2]
        for r in range(rows):
            for c in range(columns):
                y0, y1 = _inner(r, rows, h // 2)
                x0, x1 = _inner(c, columns, w // 2)
                means.append(plane[y0:y1, x0:x1].mean())
    return np.array(means)


def _inner(k: int, count: int, size: int) -> tuple[int, int]:
    """The middle half of the k-th of `count` parts of `size` pixels, at least one pixel."""
    low = int(np.ceil((k + 0.25) * size / count))
    return min(low, size - 1), max(int((k + 0.75) * size / count), min(low, size - 1) + 1)

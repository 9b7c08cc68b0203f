"""Divide the tangent curves of a fabric into stretches, each of which gets lobes of the samplers.

Stretches are coarser than the nodes of the quadrature, a handful per fabric, and their lobes are
widened by the variation of the angle inside. Measurements show that twice as many lobes reduce the
variance by a few per cent and double the cost of every density.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.sampling.lobes import STEEPEST
from fabricusd.appearance.scattering.models import model_of
from fabricusd.appearance.weave.coverage import WARP, WEFT, coverage
from fabricusd.appearance.weave.curve import pieces
from fabricusd.fabric import Fabric, TangentCurve
from fabricusd.kernels.real import INLINE

WIDEST_STRETCH = math.radians(15.0)
"""Largest range of tangent angle [rad] of a stretch on the sloping part of a curve."""

STRETCH_COLUMNS = 8
OF_SET, OF_THREAD, PSI0, COS, SIN, TAN, SURFACE_WIDTH, VOLUME_WIDTH = range(STRETCH_COLUMNS)
"""Columns of `stretches_of`."""


class Stretch(NamedTuple):
    """Thread at one tangent angle, whose lobes are drawn from; `real` is the sampler's precision.

    thread_set : int - WEFT or WARP; the same number as a real in vectorised loops
    psi0 : real - tangent angle [rad]; cos, sin, tan : real - of psi0
    surface_width, volume_width : real - standard deviations [rad] of the two normal lobes
    """

    thread_set: Any
    psi0: Any
    cos: Any
    sin: Any
    tan: Any
    surface_width: Any
    volume_width: Any


def stretches_of(fabric: Fabric) -> NDArray[np.float64]:
    """(s, STRETCH_COLUMNS) stretches of a fabric.

    The columns are the set, the thread, the tangent angle [rad], its cosine, sine and tangent, and
    the standard deviations [rad] of the two normal lobes.
    """
    rows = []
    area = coverage(fabric).type_area
    for j in (WEFT, WARP):
        for k, thread in enumerate(fabric.thread_list):
            if not area[j, k] > 0:
                continue
            for middle, deviation in _curve_stretches(thread.curve, thread.gamma_surface):
                psi0 = min(max(middle, -STEEPEST), STEEPEST)
                # Turning the tangent by x moves the mirror inclination by up to 2 x.
                widths = [
                    math.hypot(width, 2 * deviation)
                    for width in model_of(fabric, thread).widths(
                        thread.gamma_surface, thread.gamma_volume
                    )
                ]
                rows.append((j, k, psi0, math.cos(psi0), math.sin(psi0), math.tan(psi0), *widths))
    return np.array(rows, np.float64).reshape(-1, STRETCH_COLUMNS)


def _curve_stretches(curve: TangentCurve, width: float) -> list[tuple[float, float]]:
    """(mean, standard deviation) [rad] of the tangent angle over each stretch of a curve.

    Pieces of nearly constant angle form one stretch per angle; the range of the sloping pieces is
    divided into equal intervals.
    """
    p = pieces(curve)
    level = np.abs(p.last - p.first) < width
    found: list[tuple[float, float]] = []
    angles = sorted(0.5 * (p.first + p.last)[level])
    for angle in angles:
        if not found or angle - found[-1][0] > width:
            found.append((float(angle), 0.0))
    if level.all():
        return found
    low = float(np.minimum(p.first, p.last)[~level].min())
    high = float(np.maximum(p.first, p.last)[~level].max())
    count = max(1, math.ceil((high - low) / WIDEST_STRETCH - 1e-9))
    edges = np.linspace(low, high, count + 1)
    for first, last in itertools.pairwise(edges):
        a = np.clip(np.minimum(p.first, p.last)[~level], first, last)
        b = np.clip(np.maximum(p.first, p.last)[~level], first, last)
        if (b - a).max() > 1e-9:
            start, end = float(a[b > a].min()), float(b[b > a].max())
            found.append((0.5 * (start + end), (end - start) / math.sqrt(12.0)))
    return found


@njit(**INLINE)
def stretch_of(row):
    """The `Stretch` in a row of `stretches_of`."""
    return Stretch(
        int(row[OF_SET]), row[PSI0], row[COS], row[SIN], row[TAN], row[SURFACE_WIDTH],
        row[VOLUME_WIDTH],
    )  # fmt: skip


@njit(**INLINE)
def nearest_stretch(R, stretches, thread_set, thread, psi0):
    """Index of the stretch of `thread` in `thread_set` whose tangent angle is nearest to psi0."""
    best, least = 0, R(1e9)
    for y in range(stretches.shape[0]):
        row = stretches[y]
        if int(row[OF_SET]) == thread_set and int(row[OF_THREAD]) == thread:
            distance = abs(row[PSI0] - psi0)
            if distance < least:
                best, least = y, distance
    return best

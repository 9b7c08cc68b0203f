"""Importance sampling of the surface law: directions above the cloth and their exact density.

A part is uniform over the hemisphere; the rest goes to the lobes of `sampling_lobes`, three for
each of a few stretches of tangent angle. Stretches are coarser than the quadrature's nodes, a
handful a fabric, and their lobes wider by what the angle varies inside: measured, twice as many
lobes gain a few per cent of the variance and double the cost of every density. The lobes' shares
are not estimated by formulas but measured once per fabric, over a grid of views: `1/Q` moves them
too much for any closed form (on velvet the variance falls from half of uniform's to a tenth). Among
the three of one stretch they are those that leave the least variance.

Source: `docs/model.md` section 6. Scalar kernels, for the path tracer and the loops over arrays.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.blocks import node_range
from fabricusd.appearance.coverage import WARP, WEFT, coverage
from fabricusd.appearance.curve import pieces
from fabricusd.appearance.far import normalization
from fabricusd.appearance.frame import from_thread, to_thread
from fabricusd.appearance.real import INLINE, KERNEL, LEAN, atan2, cos, sin
from fabricusd.appearance.sampling_lobes import (
    ISOTROPIC,
    STEEPEST,
    SURFACE,
    VOLUME,
    lobe_densities,
    sample_lobe,
)
from fabricusd.appearance.segment import along_set, cell_lobes, seen_along, segment
from fabricusd.appearance.surface_tables import (
    NODE_COS,
    NODE_HALF,
    NODE_SIN,
    NODE_WEIGHT,
    SurfaceTables,
)
from fabricusd.appearance.thread_terms import (
    BRIGHTNESS,
    GAMMA_SURFACE,
    GAMMA_VOLUME,
    MODEL,
    THESIS,
)
from fabricusd.fabric import Fabric, TangentCurve

Reals = NDArray[Any]

UNIFORM = 0.15
"""Share of directions uniform over the hemisphere: it bounds the weight of what no lobe expects."""

WIDEST_STRETCH = math.radians(15.0)
"""Stretches of sloping curve are at most this long in tangent angle."""

ELEVATIONS, AZIMUTHS = 13, 16
"""Views at which the shares are measured: inclination 0 to 90 degrees, azimuth all round."""

STRATA = (8, 5)
"""Directions that a lobe's energy is measured with at one view."""

ADAPTATIONS = 12
"""Rounds in which the shares of a stretch's lobes are adapted."""

LEAST_SHARE = 0.1
"""Share that the lobes divide evenly among them before the measured ones: grazing views see narrow
bright places that a few directions a lobe miss, and without it satin's variance doubles."""

STRETCH_COLUMNS = 8
SET, THREAD, PSI0, COS, SIN, TAN, SURFACE_WIDTH, VOLUME_WIDTH = range(STRETCH_COLUMNS)
"""Columns of `SamplingTables.stretches`."""


class SamplingTables(NamedTuple):
    """What the sampler reads; `real` is the surface tables' precision.

    stretches : (s, 8) real - a tangent angle [rad] of a thread in a set, its cosine, sine, tangent,
        the deviations of its two normal lobes [rad]
    shares : (ELEVATIONS, AZIMUTHS, 3 s) real - of every stretch's three lobes; they sum to
        1 - UNIFORM at each view
    """

    stretches: Reals
    shares: Reals


def sampling_tables(fabric: Fabric, tables: SurfaceTables) -> SamplingTables:
    """Stretches of `fabric` and the shares of their lobes, measured on `tables`."""
    R = tables.nodes.dtype.type
    rows = stretches_of(fabric)
    psi0 = np.arctan2(tables.nodes[:, NODE_SIN], tables.nodes[:, NODE_COS])
    sets = np.where(np.arange(len(psi0)) >= tables.warp_start, WARP, WEFT)
    owner = owners(rows, psi0, sets, tables.node_thread)
    stretches = rows.astype(R)
    energy = np.zeros((ELEVATIONS, AZIMUTHS, 3 * len(rows)))
    single: Any = np.float32
    if len(rows):
        _measure(single, _in_single_precision(tables), rows.astype(single), owner, energy)
    total = energy.sum(axis=2, keepdims=True)
    even = 1.0 / max(energy.shape[2], 1)
    measured = np.where(total > 0, energy / np.where(total > 0, total, 1.0), even)
    shares = (1.0 - UNIFORM) * ((1.0 - LEAST_SHARE) * measured + LEAST_SHARE * even)
    return SamplingTables(stretches, np.ascontiguousarray(shares, dtype=R))


def stretches_of(fabric: Fabric) -> NDArray[np.float64]:
    """(s, 8) `SamplingTables.stretches` of a fabric."""
    rows = []
    area = coverage(fabric).type_area
    for j in (WEFT, WARP):
        for k, thread in enumerate(fabric.thread_list):
            if not area[j, k] > 0:
                continue
            for middle, deviation in _curve_stretches(thread.curve, thread.gamma_surface):
                psi0 = min(max(middle, -STEEPEST), STEEPEST)
                # A tangent turned by x moves the mirror inclination by up to 2 x.
                widths = [
                    math.hypot(2 * g, 2 * deviation)
                    for g in (thread.gamma_surface, thread.gamma_volume)
                ]
                rows.append((j, k, psi0, math.cos(psi0), math.sin(psi0), math.tan(psi0), *widths))
    return np.array(rows, np.float64).reshape(-1, STRETCH_COLUMNS)


def _curve_stretches(curve: TangentCurve, width: float) -> list[tuple[float, float]]:
    """(mean, standard deviation) [rad] of the tangent angle over each stretch of a curve.

    Level pieces of one angle are a stretch together, sloping ones share equal intervals of angle.
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


def owners(
    rows: NDArray[np.float64],
    psi0: NDArray[Any],
    sets: NDArray[np.intp],
    threads: NDArray[np.int32],
) -> NDArray[np.int32]:
    """(q,) the stretch that each quadrature node belongs to: the nearest of its thread and set."""
    if not len(rows):
        return np.zeros(0, np.int32)
    distance = np.abs(psi0[:, None] - rows[:, PSI0])
    other = (sets[:, None] != rows[:, SET]) | (threads[:, None] != rows[:, THREAD])
    return np.argmin(np.where(other, np.inf, distance), axis=1).astype(np.int32)


def _in_single_precision(tables: SurfaceTables) -> SurfaceTables:
    """Shares need no more, and one kernel serves both precisions."""
    return tables._replace(
        threads=tables.threads.astype(np.float32),
        smooth=tables.smooth.astype(np.float32),
        nodes=tables.nodes.astype(np.float32),
        gap=np.float32(tables.gap),
        overlap_precision=np.float32(tables.overlap_precision),
    )


@njit(**KERNEL)
def _measure(R, tables, stretches, owner, energy):
    """Energy of every stretch at every view, by directions drawn from its lobes, shared by them."""
    drawn = np.empty((3 * STRATA[0] * STRATA[1], 4), stretches.dtype)
    for view in range(ELEVATIONS * AZIMUTHS):
        _measure_view(R, tables, stretches, owner, view // AZIMUTHS, view % AZIMUTHS, drawn, energy)


@njit(**LEAN)
def _measure_view(R, tables, stretches, owner, e, a, drawn, energy):
    # Short of 90 degrees, where nothing is seen.
    theta = R(0.5 * math.pi) * min(R(e) / R(ELEVATIONS - 1), R(0.99))
    phi = R(2 * math.pi / AZIMUTHS) * R(a)
    ox, oy = sin(R, theta) * cos(R, phi), sin(R, theta) * sin(R, phi)
    oz = cos(R, theta)
    for y in range(stretches.shape[0]):
        for lobe in range(3):
            _draw_lobe(R, tables, stretches, owner, y, lobe, ox, oy, oz, drawn)
        total, shares = _best_shares(R, drawn)
        for lobe in range(3):
            energy[e, a, 3 * y + lobe] = total * shares[lobe]


@njit(**LEAN)
def _draw_lobe(R, tables, stretches, owner, y, lobe, ox, oy, oz, drawn):
    """The stretch's part of the far value and the densities of its lobes, at one lobe's draws.

    drawn : (3 draws, 4), the lobe's own rows of it: value, three densities [1/sr]
    """
    row = stretches[y]
    thread_set = int(row[SET])
    first, last = node_range(tables, thread_set)
    t_o, _, _ = to_thread(R, thread_set, row[COS], row[SIN], ox, oy, oz)
    theta_o = atan2(R, t_o, math.sqrt(max(R(1) - t_o * t_o, R(0))))
    width = row[SURFACE_WIDTH] if lobe == SURFACE else row[VOLUME_WIDTH]
    for m in range(STRATA[0] * STRATA[1]):
        found = drawn[lobe * STRATA[0] * STRATA[1] + m]
        found[0] = R(0)
        u1 = (R(m % STRATA[0]) + R(0.5)) / R(STRATA[0])
        u2 = (R(m // STRATA[0]) + R(0.5)) / R(STRATA[1])
        t, b, n = sample_lobe(R, lobe, row[PSI0], row[TAN], width, theta_o, u1, u2)
        ix, iy, iz = from_thread(R, thread_set, row[COS], row[SIN], t, b, n)
        if iz <= R(1e-6) or n <= R(1e-6):
            continue
        found[1], found[2], found[3] = lobe_densities(
            R, row[PSI0], row[TAN], row[SURFACE_WIDTH], row[VOLUME_WIDTH], theta_o, t, b, n
        )
        q = normalization(R, tables, ix, iy, iz, ox, oy, oz)
        if q <= R(1e-9) or found[1 + lobe] <= R(1e-12):
            continue
        a_i, b_i, scale_i, a_o, b_o, scale_o, u = along_set(
            R, thread_set, tables.overlap_precision, ix, iy, iz, ox, oy, oz
        )
        for k in range(first, last):
            if owner[k] != y or tables.published[k] == 0:
                continue
            c, s = tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN]
            p = tables.nodes[k, NODE_WEIGHT] * seen_along(
                R, c, s, a_i, iz, scale_i, a_o, oz, scale_o, u
            )
            if p > R(0):
                found[0] += p * _grey(R, tables, k, c, s, a_i, b_i, iz, a_o, b_o, oz) / q


@njit(**INLINE)
def _best_shares(R, drawn):
    """Energy of the draws, and the shares of the three lobes that leave the least variance.

    Minimises the integral of f^2/p over the lobes' shares by its fixed point, as mixtures are
    adapted in population Monte Carlo [Douc2007]; `p` has the uniform part. Each iteration lessens
    it.
    """
    first, second, third = R(1.0 / 3.0), R(1.0 / 3.0), R(1.0 / 3.0)
    energy = R(0)
    count = drawn.shape[0] // 3
    for step in range(ADAPTATIONS):
        a, b, c = R(0), R(0), R(0)
        for m in range(drawn.shape[0]):
            value = drawn[m, 0]
            if not value > R(0):
                continue
            d0, d1, d2 = drawn[m, 1], drawn[m, 2], drawn[m, 3]
            even = d0 + d1 + d2
            if step == 0:
                energy += value / (even * R(count))
            p = R(UNIFORM / (2 * math.pi)) + R(1 - UNIFORM) * (
                first * d0 + second * d1 + third * d2
            )
            weight = value * value / (p * p * even)
            a, b, c = a + weight * first * d0, b + weight * second * d1, c + weight * third * d2
        total = a + b + c
        if not total > R(0):
            break
        first, second, third = a / total, b / total, c / total
    return energy, (first, second, third)


@njit(**INLINE)
def _grey(R, tables, k, c, s, a_i, b_i, iz, a_o, b_o, oz):
    """`f_s M cos theta_i` at node k, the albedo's channels averaged."""
    thread = tables.node_thread[k]
    row = tables.threads[thread]
    surface, volume = segment(
        R, row[MODEL] == R(THESIS), tables.smooth[thread], tables.overlap_precision,
        c, s, a_i, b_i, iz, a_o, b_o, oz,
    )  # fmt: skip
    on_surface, on_volume = cell_lobes(
        R, row, tables.nodes[k, NODE_HALF], c, s, a_i, b_i, iz, a_o, b_o, oz
    )
    return surface * on_surface + volume * on_volume * row[BRIGHTNESS]


@njit(**INLINE)
def view_corner(R, ox, oy, oz):
    """Where a view lies on the grid of shares: (elevation, next azimuths, two fractions)."""
    flat = math.sqrt(ox * ox + oy * oy)
    e = atan2(R, flat, max(oz, R(0))) * R((ELEVATIONS - 1) / (0.5 * math.pi))
    row = min(int(e), ELEVATIONS - 2)
    a = atan2(R, oy, ox) * R(AZIMUTHS / (2 * math.pi))
    a = a if a >= R(0) else a + R(AZIMUTHS)
    column = min(int(a), AZIMUTHS - 1)
    return row, column, (column + 1) % AZIMUTHS, e - R(row), a - R(column)


@njit(**INLINE)
def share_at(R, shares, corner, k):
    """Share of lobe k at a view, bilinear in the grid."""
    row, column, following, e, a = corner
    low = shares[row, column, k] + a * (shares[row, following, k] - shares[row, column, k])
    row += 1
    high = shares[row, column, k] + a * (shares[row, following, k] - shares[row, column, k])
    return low + e * (high - low)


@njit(**LEAN)
def far_density(R, sampling, ix, iy, iz, ox, oy, oz):
    """pdf(wi) [1/sr] of `far_direction`; 0 at or below the cloth."""
    if iz <= R(0) or oz <= R(0):
        return R(0)
    if sampling.stretches.shape[0] == 0:
        return R(0.5 / math.pi)
    corner = view_corner(R, ox, oy, oz)
    p = R(UNIFORM / (2 * math.pi))
    for y in range(sampling.stretches.shape[0]):
        row = sampling.stretches[y]
        thread_set = int(row[SET])
        t, b, n = to_thread(R, thread_set, row[COS], row[SIN], ix, iy, iz)
        if n <= R(0):
            continue
        t_o, b_o, n_o = to_thread(R, thread_set, row[COS], row[SIN], ox, oy, oz)
        theta_o = atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
        on_surface, on_volume, isotropic = lobe_densities(
            R, row[PSI0], row[TAN], row[SURFACE_WIDTH], row[VOLUME_WIDTH], theta_o, t, b, n
        )
        p += share_at(R, sampling.shares, corner, 3 * y + SURFACE) * on_surface
        p += share_at(R, sampling.shares, corner, 3 * y + VOLUME) * on_volume
        p += share_at(R, sampling.shares, corner, 3 * y + ISOTROPIC) * isotropic
    return p


@njit(**INLINE)
def uniform_direction(R, u1, u2):
    """Uniform over the upper hemisphere."""
    flat = math.sqrt(max(R(0), (R(1) - u1) * (R(1) + u1)))
    phi = R(2 * math.pi) * u2
    return flat * cos(R, phi), flat * sin(R, phi), u1


@njit(**LEAN)
def far_direction(R, sampling, ox, oy, oz, u0, u1, u2):
    """wi (x, y, z) for a viewer above the cloth and three numbers in [0, 1)."""
    left = u0 - R(UNIFORM)
    if left < R(0) or sampling.stretches.shape[0] == 0:
        return uniform_direction(R, u1, u2)
    corner = view_corner(R, ox, oy, oz)
    last = 3 * sampling.stretches.shape[0] - 1
    k = 0
    while k < last:
        left -= share_at(R, sampling.shares, corner, k)
        if left < R(0):
            break
        k += 1
    row = sampling.stretches[k // 3]
    thread_set = int(row[SET])
    t_o, b_o, n_o = to_thread(R, thread_set, row[COS], row[SIN], ox, oy, oz)
    theta_o = atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    lobe = k % 3
    width = row[SURFACE_WIDTH] if lobe == SURFACE else row[VOLUME_WIDTH]
    t, b, n = sample_lobe(R, lobe, row[PSI0], row[TAN], width, theta_o, u1, u2)
    return from_thread(R, thread_set, row[COS], row[SIN], t, b, n)


@njit(**INLINE)
def nearest_stretch(R, stretches, thread_set, thread, psi0):
    """The stretch of a thread in a set whose tangent angle is nearest to psi0."""
    best, least = 0, R(1e9)
    for y in range(stretches.shape[0]):
        row = stretches[y]
        if int(row[SET]) == thread_set and int(row[THREAD]) == thread:
            distance = abs(row[PSI0] - psi0)
            if distance < least:
                best, least = y, distance
    return best


@njit(**INLINE)
def _point_shares(R, sampling, thread_set, thread, psi0, ox, oy, oz):
    """(surface, volume, isotropic) shares at one tangent angle: those of the stretch it is in."""
    y = 3 * nearest_stretch(R, sampling.stretches, thread_set, thread, psi0)
    corner = view_corner(R, ox, oy, oz)
    surface = share_at(R, sampling.shares, corner, y + SURFACE)
    volume = share_at(R, sampling.shares, corner, y + VOLUME)
    isotropic = share_at(R, sampling.shares, corner, y + ISOTROPIC)
    scale = R(1.0 - UNIFORM) / (surface + volume + isotropic)
    return surface * scale, volume * scale, isotropic * scale


@njit(**LEAN)
def point_density(R, tables, sampling, thread_set, thread, psi0, ix, iy, iz, ox, oy, oz):
    """pdf(wi) [1/sr] of `point_direction`; 0 at or below the cloth."""
    if iz <= R(0) or oz <= R(0):
        return R(0)
    if thread_set > WARP or sampling.stretches.shape[0] == 0:
        return R(0.5 / math.pi)
    p = R(UNIFORM / (2 * math.pi))
    psi0 = min(max(psi0, R(-STEEPEST)), R(STEEPEST))
    c, s = cos(R, psi0), sin(R, psi0)
    t, b, n = to_thread(R, thread_set, c, s, ix, iy, iz)
    if n <= R(0):
        return p
    t_o, b_o, n_o = to_thread(R, thread_set, c, s, ox, oy, oz)
    theta_o = atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    row = tables.threads[thread]
    surface, volume, isotropic = _point_shares(R, sampling, thread_set, thread, psi0, ox, oy, oz)
    on_surface, on_volume, on_isotropic = lobe_densities(
        R, psi0, s / c, R(2) * row[GAMMA_SURFACE], R(2) * row[GAMMA_VOLUME], theta_o, t, b, n
    )
    return p + surface * on_surface + volume * on_volume + isotropic * on_isotropic


@njit(**LEAN)
def point_direction(R, tables, sampling, thread_set, thread, psi0, ox, oy, oz, u0, u1, u2):
    """wi (x, y, z) at levels `weave` and `thread`, for a viewer above the cloth.

    A gap, whose value is 0 everywhere, is sampled uniformly.
    """
    left = u0 - R(UNIFORM)
    if left < R(0) or thread_set > WARP or sampling.stretches.shape[0] == 0:
        return uniform_direction(R, u1, u2)
    psi0 = min(max(psi0, R(-STEEPEST)), R(STEEPEST))
    c, s = cos(R, psi0), sin(R, psi0)
    row = tables.threads[thread]
    surface, volume, _ = _point_shares(R, sampling, thread_set, thread, psi0, ox, oy, oz)
    lobe, width = ISOTROPIC, R(0)
    if left < surface:
        lobe, width = SURFACE, R(2) * row[GAMMA_SURFACE]
    elif left < surface + volume:
        lobe, width = VOLUME, R(2) * row[GAMMA_VOLUME]
    t_o, b_o, n_o = to_thread(R, thread_set, c, s, ox, oy, oz)
    theta_o = atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    t, b, n = sample_lobe(R, lobe, psi0, s / c, width, theta_o, u1, u2)
    return from_thread(R, thread_set, c, s, t, b, n)

"""Multiple scattering of `conserving` cloth, from a table of what single scattering loses.

From light that arrives from w, single scattering of a white cloth reflects the share `rho_R` and
transmits the share `rho_T`; the rest, `m(w) = 1 - gap - rho_R - rho_T`, is scattered from thread to
thread. Following [KullaConty2017] it leaves as

    f_ms = C m(wi) m(wo) / (pi M) {1 - tau on the same side, tau on the other},
    M = (1/pi) integral over one side of m |N.w| dw, from the *interpolated* table,

so that at albedo 1 all energy comes back, up to the error of the table. Per channel
`C = alpha^2 p / (1 - alpha (1 - p))`: after its first scattering, light meets threads of mean
albedo alpha and escapes with probability p at each of them. Opaque cloth transmits nothing: `m`
then includes the light that would have passed, and all of it leaves on its own side. Source: MODEL
section 7.

The table is indexed by polar angle and azimuth, because an average over azimuth is 12-15 % wrong on
satin. Row t in [0, 1] lies at the polar angle 90 sin(90 t) degrees. Narrow lobes make m steep
within their width of the horizon, and the rows are dense there. At the horizon m is an even
function of 1 - t, and at the pole it continues on the opposite side, so cubic interpolation needs
no one-sided stencil.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.conserving.single import (
    NODE_COS,
    NODE_SIN,
    NODE_WEIGHT,
    ConservingTables,
    conserving_point_single,
    conserving_single,
    facing,
    single_tables,
    visible,
)
from fabricusd.appearance.frame import from_thread, to_thread
from fabricusd.appearance.scattering.columns import ALBEDO_B, ALBEDO_R, BRIGHTNESS
from fabricusd.appearance.scattering.model import CONSERVING
from fabricusd.appearance.scattering.models import model_of
from fabricusd.appearance.scattering.sampling import density, sample_direction
from fabricusd.appearance.scattering.terms import terms
from fabricusd.appearance.weave.coverage import WARP, WEFT, coverage
from fabricusd.appearance.weave.curve import is_pile
from fabricusd.appearance.weave.quadrature import Rule
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import INLINE, KERNEL, LEAN, PART, acos, asin, atan2

Reals = NDArray[Any]

WOVEN_TABLE = (25, 24, 8192)
PILE_TABLE = (25, 72, 4096)
"""Number of polar angles from N to the horizon, of azimuths over a full turn, and of points of the
low-discrepancy sequence per entry. Pile has a ridge a few degrees wide in azimuth, at which 36
azimuths are wrong by 1 %. Pile scatters a tenth as much light once as woven cloth does, so fewer
points give the same absolute error."""
HORIZON = 1e-3
"""N.w at which the last row is measured; it stands for the limit at the horizon."""


def conserving_tables(
    fabric: Fabric,
    *,
    precision: type[np.floating[Any]] = np.float64,
    multiple: bool = True,
    rule: Rule | None = None,
) -> ConservingTables:
    """Tables of `fabric` in `precision`, with the multiple-scattering term if `multiple`.

    Published models and dark opaque cloth do not need the term, whose table takes about a second to
    compute.
    """
    tables = single_tables(fabric, precision=precision, rule=rule)
    if not multiple or not tables.scatters.any():
        return tables
    reflected, transmitted = scattered_shares(tables, fabric)
    if tables.opaque:
        transmitted = np.zeros_like(transmitted)
    covered = float(tables.covered)
    lost = np.maximum(covered - reflected - transmitted, 0.0)
    tables = tables._replace(lost=np.ascontiguousarray(lost, dtype=precision))
    lost_mean = mean_lost(tables)
    r, t = mean_share(reflected), mean_share(transmitted)
    escape = 1.0 - lost_mean / covered
    alpha = mean_albedo(fabric)
    strength = alpha**2 * escape / (1.0 - alpha * (1.0 - escape))
    scale = 1.0 / (math.pi * lost_mean) if lost_mean > 0 else 0.0
    return tables._replace(
        strength=(strength * scale).astype(precision),
        forward=precision(t / (r + t) if r + t > 0 else 0.0),
    )


def mean_albedo(fabric: Fabric) -> NDArray[np.float64]:
    """(3,) alpha: the albedo of the threads under diffuse light, weighted by covered area.

    A thread of a published model counts as black, because its A is not an albedo.
    """
    area = coverage(fabric).type_area.sum(axis=0)
    total = np.zeros(3)
    for share, thread in zip(area, fabric.thread_list, strict=True):
        model = model_of(fabric, thread)
        if model.law == CONSERVING:
            through = model.transmission(thread) if model.transmission else np.ones(2)
            surface = _mean_surface_albedo(1.0 - through)
            total += float(share) * (surface + (1.0 - surface) * np.clip(thread.albedo, 0.0, 1.0))
    return np.asarray(total / max(float(area.sum()), 1e-300))


def _mean_surface_albedo(albedo: NDArray[np.float64]) -> float:
    """(2/pi) times the integral of E cos^2 theta over +-90 degrees.

    albedo : E at evenly spaced sqrt(cos theta)
    """
    cos_theta = np.linspace(0.0, 1.0, len(albedo)) ** 2
    theta = np.arccos(cos_theta)
    # theta decreases along the table, hence the sign.
    return -4.0 / math.pi * float(np.trapezoid(albedo * cos_theta**2, theta))


def scattered_shares(
    tables: ConservingTables, fabric: Fabric, draws: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(rho_R, rho_T), each (rows, columns): reflectance and transmittance of a white cloth by
    single scattering.

    Opaque cloth is measured as if it transmitted light, so that both shares are those of the
    facets.

    draws : points per entry; 0 takes the default
    """
    pile = any(is_pile(t.curve) for t in fabric.thread_list)
    *shape, default = PILE_TABLE if pile else WOVEN_TABLE
    threads = tables.threads.astype(np.float32)
    threads[:, ALBEDO_R : ALBEDO_B + 1] = 1.0
    threads[:, BRIGHTNESS] = 1.0
    white = tables._replace(
        threads=threads,
        nodes=tables.nodes.astype(np.float32),
        covered=np.float32(tables.covered),
        lost=tables.lost.astype(np.float32),
        strength=tables.strength.astype(np.float32),
        forward=np.float32(tables.forward),
    )
    out = np.zeros((2, *shape))
    _measure(np.float32, white, draws or default, out)
    return out[0], out[1]


@njit(**INLINE)
def _polar_angle(t):
    """Polar angle [rad] of the row t in [0, 1]."""
    return 0.5 * math.pi * math.sin(0.5 * math.pi * t)


@njit(**KERNEL, parallel=True)
def _measure(R, tables, draws, out):
    rows, columns = out.shape[1], out.shape[2]
    for entry in prange(rows * columns):
        row, column = entry // columns, entry % columns
        z = max(math.cos(_polar_angle(row / (rows - 1))), HORIZON)
        phi = 2.0 * math.pi * column / columns
        around = math.sqrt(1.0 - z * z)
        reflected, transmitted = _shares(
            R, tables, draws, R(around * math.cos(phi)), R(around * math.sin(phi)), R(z)
        )
        out[0, row, column], out[1, row, column] = reflected, transmitted


@njit(**PART)
def _shares(R, tables, draws, x, y, z):
    """(rho_R, rho_T) of light from (x, y, z), z > 0.

    Facets are drawn by the area that (x, y, z) sees of them, directions by the thread's sampler.
    """
    reflected, transmitted = 0.0, 0.0
    total = 0.0
    for k in range(tables.nodes.shape[0]):
        total += _seen(R, tables, k, x, y, z)
    k, below, here = -1, 0.0, 0.0
    for n in range(draws):
        target = total * (n + 0.5) / draws
        # The targets increase with n, so the search for the facet only moves forward.
        while k < tables.nodes.shape[0] - 1 and (k < 0 or below + here <= target):
            below += here
            k += 1
            here = _seen(R, tables, k, x, y, z)
        warp = WARP if k >= tables.warp_start else WEFT
        c, s = tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN]
        row = tables.threads[tables.node_thread[k]]
        a, b, d = to_thread(R, warp, c, s, x, y, z)
        # The remainder of the target inside its facet chooses the lobe, so each lobe of each facet
        # gets a contiguous range of the R2 sequence [Roberts2018]: 1/x and 1/x^2 with x^3 = x + 1.
        u0 = R(min(max((target - below) / here, 0.0), 1.0))
        u1 = R((n * 0.7548776662466927 + 0.5) % 1.0)
        u2 = R((n * 0.5698402909980532 + 0.5) % 1.0)
        va, vb, vd = sample_direction(R, row, a, b, d, u0, u1, u2)
        p = density(R, row, va, vb, vd, a, b, d)
        surface, volume = terms(R, row, va, vb, vd, a, b, d)
        vx, vy, vz = from_thread(R, warp, c, s, va, vb, vd)
        seen = max(R(0), vd if vz > R(0) else -vd)
        value = float((surface + volume) * seen * visible(R, tables, vx, vy, vz) * abs(vz) / p)
        if vz > R(0):
            reflected += value
        else:
            transmitted += value
    scale = total * float(visible(R, tables, x, y, z)) / draws
    return reflected * scale, transmitted * scale


@njit(**INLINE)
def _seen(R, tables, k, x, y, z):
    """a q mu(w) of node k for w above the cloth; 0 if the node's thread does not scatter."""
    along = y if k >= tables.warp_start else x
    mu = facing(R, R(1), tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN], along, z)
    return float(tables.nodes[k, NODE_WEIGHT] * mu) * tables.scatters[k]


def mean_share(table: NDArray[np.float64]) -> float:
    """(1/pi) times the cosine-weighted integral of a table over one side, by the trapezium rule."""
    theta = 0.5 * math.pi * np.sin(0.5 * math.pi * np.linspace(0.0, 1.0, table.shape[0]))
    return float(np.trapezoid(table.mean(axis=1), np.sin(theta) ** 2))


def mean_lost(tables: ConservingTables) -> float:
    """M, from Gauss-Legendre points in every cell of the interpolated table; 0 without a table."""
    if tables.lost.size == 0:
        return 0.0
    x, w = np.polynomial.legendre.leggauss(4)
    return float(_integrate_table(np.float64, tables.lost.astype(np.float64), x, w))


@njit(**LEAN)
def _integrate_table(R, lost, x, w):
    rows, columns = lost.shape
    turn = 2.0 * math.pi / columns
    total = 0.0
    for i in range((rows - 1) * x.size):
        row = i // x.size
        low, high = _polar_angle(row / (rows - 1)), _polar_angle((row + 1) / (rows - 1))
        theta = low + 0.5 * (high - low) * (x[i % x.size] + 1.0)
        weight = 0.5 * (high - low) * w[i % x.size] * math.sin(theta) * math.cos(theta)
        for j in range(columns * x.size):
            phi = turn * (j // x.size + 0.5 * (x[j % x.size] + 1.0))
            m = lost_share(
                R, lost, math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi),
                math.cos(theta),
            )  # fmt: skip
            total += weight * 0.5 * turn * w[j % x.size] * m
    return total / math.pi


@njit(**INLINE)
def _cubic(R, a, b, c, d, t):
    """Catmull-Rom interpolation between b and c."""
    return b + R(0.5) * t * (
        c - a + t * (R(2) * a - R(5) * b + R(4) * c - d + t * (R(3) * (b - c) + d - a))
    )


@njit(**PART)
def _across_columns(R, lost, row, column, t):
    """The table interpolated along azimuth, in a row that may lie beyond the pole or the
    horizon."""
    rows, columns = lost.shape
    half = columns // 2
    if row < 0:
        row, column = -row, column + half
    elif row > rows - 1:
        row = 2 * (rows - 1) - row
    return _cubic(
        R,
        lost[row, (column + columns - 1) % columns],
        lost[row, column % columns],
        lost[row, (column + 1) % columns],
        lost[row, (column + 2) % columns],
        t,
    )


@njit(**PART)
def lost_share(R, lost, x, y, z):
    """m(w) >= 0, interpolated cubically between rows and azimuths; m(-w) = m(w)."""
    if z < R(0):
        x, y, z = -x, -y, -z
    rows, columns = lost.shape
    t = asin(R, acos(R, z) * R(2 / math.pi)) * R(2 / math.pi)
    i = t * R(rows - 1)
    j = atan2(R, y, x) * R(columns / (2.0 * math.pi))
    if j < R(0):
        j += R(columns)
    row, column = min(int(i), rows - 2), int(j)
    t, u = i - R(row), j - R(column)
    return max(
        R(0),
        _cubic(
            R,
            _across_columns(R, lost, row - 1, column, u),
            _across_columns(R, lost, row, column, u),
            _across_columns(R, lost, row + 1, column, u),
            _across_columns(R, lost, row + 2, column, u),
            t,
        ),
    )


@njit(**PART)
def multiple_share(R, tables, ix, iy, iz, ox, oy, oz):
    """f_ms |N.wi| per unit `tables.strength`: the factor that all channels share."""
    if tables.lost.shape[0] == 0 or iz == R(0) or oz == R(0):
        return R(0)
    m = lost_share(R, tables.lost, ix, iy, iz) * lost_share(R, tables.lost, ox, oy, oz)
    same = (iz > R(0)) == (oz > R(0))
    return m * abs(iz) * (R(1) - tables.forward if same else tables.forward)


@njit(**PART)
def conserving_value(R, tables, ix, iy, iz, ox, oy, oz):
    """(r, g, b) of the whole repeat: radiance per unit `L_i dwi`, on both sides of the cloth."""
    red, green, blue = conserving_single(R, tables, ix, iy, iz, ox, oy, oz)
    share = multiple_share(R, tables, ix, iy, iz, ox, oy, oz)
    return (
        red + share * tables.strength[0],
        green + share * tables.strength[1],
        blue + share * tables.strength[2],
    )


@njit(**PART)
def conserving_point_value(R, tables, place, ix, iy, iz, ox, oy, oz):
    """(r, g, b) at a `Place` on a thread; the mean over the repeat is `conserving_value`.

    The multiple-scattering term belongs to the covered area: there is none in a gap.
    """
    red, green, blue = conserving_point_single(R, tables, place, ix, iy, iz, ox, oy, oz)
    share = multiple_share(R, tables, ix, iy, iz, ox, oy, oz) / tables.covered
    return (
        red + share * tables.strength[0],
        green + share * tables.strength[1],
        blue + share * tables.strength[2],
    )

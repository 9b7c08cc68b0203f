"""`conserving` cloth as a whole: its light by side, after one scattering and after more.

From light that arrives from w, single scattering of a white cloth reflects the share `rho_R` and
transmits the share `rho_T`. The factors of `single` are found here, such that these are the shares
that the fabric states (`by_side`). The rest, `m(w) = 1 - gap(w) - rho_R - rho_T`, is scattered from
thread to thread; `tau(w)` of it leaves on the other side. Following [KullaConty2017], on each side

    f_ms = C m_s(wi) m_s(wo)/(pi M_s),  m_s = (1 - tau) m on the same side, tau m on the other,
    M_s = (1/pi) integral over one side of m_s |N.w| dw, from the *interpolated* table,

so that at albedo 1 all energy comes back, up to the error of the table. Per channel
`C = alpha^2 p / (1 - alpha (1 - p))`: after its first scattering, light meets threads of mean
albedo alpha and escapes with probability p at each of them. Opaque cloth transmits nothing: `m`
then includes the light that would have passed, and all of it leaves on its own side. Source: MODEL
section 7.

For pile no shares are known: its factors are 1, and tau is that of single scattering.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.cloth_key import cloth_key
from fabricusd.appearance.conserving.by_side import by_side
from fabricusd.appearance.conserving.facets import SURFACE, VOLUME, Facets, white, white_facets
from fabricusd.appearance.conserving.grid import bordered, entry_angles, mean_share, side_at
from fabricusd.appearance.conserving.single import (
    LOST,
    ON_SURFACE,
    ON_VOLUME,
    ConservingTables,
    conserving_point_single,
    conserving_single,
    single_tables,
)
from fabricusd.appearance.scattering.model import CONSERVING
from fabricusd.appearance.scattering.models import model_of
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.appearance.weave.quadrature import Rule
from fabricusd.cache import kept
from fabricusd.fabric import Fabric
from fabricusd.kernels.cache import fingerprint
from fabricusd.kernels.real import PART

Floats = NDArray[np.float64]

STEPS = 60
"""Most iterations for a factor; the presets take 10 to 20."""

SETTLED = 1e-4
"""Error of the shares at which the iteration for a factor ends."""

DARK = 1e-9
"""Share of the light below which a term has no factor: it would divide by next to nothing."""


def conserving_tables(
    fabric: Fabric,
    *,
    precision: type[np.floating[Any]] = np.float64,
    multiple: bool = True,
    rule: Rule | None = None,
) -> ConservingTables:
    """Tables of `fabric` in `precision`, with the multiple-scattering term if `multiple`.

    The factors and the term take about a second to compute, once per weave, curves, lobes and
    stated shares; the cache keeps them. They do not depend on `rule`, which is the quadrature of
    single scattering.
    """
    tables = single_tables(fabric, precision=precision, rule=rule)
    if not tables.scatters.any():
        return tables
    key = (fingerprint(), *cloth_key(white(fabric)))
    found = kept("sides", key, lambda: _sides_and_gap(fabric))
    sides, gap = found[..., :3].copy(), found[0, ..., 3]
    if not multiple:
        sides[..., LOST] = 0.0
    sides = sides.astype(precision)
    tables = tables._replace(sides=bordered(sides), gap=np.ascontiguousarray(gap, dtype=precision))
    lost = [mean_share(sides[side, :, :, LOST]) for side in range(2)]
    escape = 1.0 - sum(lost) / max(mean_share(1.0 - gap), 1e-300)
    alpha = mean_albedo(fabric)
    strength = alpha**2 * escape / (1.0 - alpha * (1.0 - escape))
    scale = np.array([1.0 / (math.pi * m) if m > 0 else 0.0 for m in lost])
    return tables._replace(strength=(scale[:, None] * strength).astype(precision))


def _sides_and_gap(fabric: Fabric) -> Floats:
    """(2, rows, columns, 4): `ConservingTables.sides` without the border, and gap(w) behind it."""
    facets = white_facets(fabric)
    rows, columns = facets.shape
    out = np.zeros((2, rows, columns, 4))
    sides = out[..., :3]
    pile = facets.sent.shape[-1] == 1
    theta, phi = entry_angles(rows, columns)
    stated = by_side(fabric, theta, phi)
    gap = np.full(theta.shape, coverage(fabric).gap) if pile else stated.gap
    covered = 1.0 - gap
    once = _pile_once(facets, sides) if pile else _fit_once(facets, stated, covered, sides)
    if fabric.opaque:
        once[1] = 0.0
    rest = np.maximum(covered - once.sum(axis=0), 0.0)
    forward = stated.forward
    if pile or fabric.opaque:
        r, t = mean_share(once[0]), mean_share(once[1])
        forward = np.full(theta.shape, t / (r + t) if r + t > 0 else 0.0)
    sides[0, :, :, LOST], sides[1, :, :, LOST] = (1.0 - forward) * rest, forward * rest
    out[..., 3] = gap
    return out


def _pile_once(facets: Facets, sides: Floats) -> Floats:
    """(2, rows, columns) shares that leave at once by side; factors of 1 are written to `sides`."""
    sides[:, :, :, [ON_SURFACE, ON_VOLUME]] = 1.0
    return np.asarray(facets.sent.sum(axis=(2, 3), dtype=np.float64).T.reshape(2, *facets.shape))


def _fit_once(facets: Facets, stated: Any, covered: Floats, sides: Floats) -> Floats:
    """(2, rows, columns) shares that leave at once by side; factors are written to `sides`."""
    surface = facets.surface.reshape(facets.shape).astype(np.float64)
    inside = covered * (1.0 - surface)
    wanted = (
        ((0, SURFACE), (ON_SURFACE,), covered * surface * stated.surface),
        ((0, VOLUME), (ON_VOLUME,), inside * stated.reflected),
        ((1, slice(None)), (ON_SURFACE, ON_VOLUME), inside * stated.transmitted),
    )
    once = np.zeros((2, *facets.shape))
    for (side, term), columns, share in wanted:
        sent = facets.sent[:, side, term]
        matrix = sent if sent.ndim == 2 else sent.sum(axis=1)
        factor, found = fitted_factor(matrix.astype(np.float64), share.ravel())
        for column in columns:
            sides[side, :, :, column] = factor.reshape(facets.shape)
        once[side] += found.reshape(facets.shape)
    return once


def fitted_factor(matrix: Floats, share: Floats) -> tuple[Floats, Floats]:
    """(h, h (matrix h)), each (n,): the symmetric scaling with which as much leaves as `share`.

    matrix : (n, n) and share : (n,), at least 0. Where the matrix sends nothing, h stays 1.
    """
    factor = np.ones(len(share))
    found = factor * (matrix @ factor)
    for _ in range(STEPS):
        bright = found > DARK
        if float(np.abs(found - share)[bright].max(initial=0.0)) < SETTLED:
            break
        # The square root halves the step: both ends of every path take the factor.
        factor[bright] *= np.sqrt(share[bright] / found[bright])
        found = factor * (matrix @ factor)
    return factor, found


def mean_albedo(fabric: Fabric) -> Floats:
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


def _mean_surface_albedo(albedo: Floats) -> float:
    """(2/pi) times the integral of E cos^2 theta over +-90 degrees.

    albedo : E at evenly spaced sqrt(cos theta)
    """
    cos_theta = np.linspace(0.0, 1.0, len(albedo)) ** 2
    theta = np.arccos(cos_theta)
    # theta decreases along the table, hence the sign.
    return -4.0 / math.pi * float(np.trapezoid(albedo * cos_theta**2, theta))


@njit(**PART)
def between_sides(R, tables, ix, iy, iz, ox, oy, oz):
    """(h(wi) h(wo) of the surface term, of the volume term, f_ms |N.wi| per unit `strength`)."""
    if tables.sides.shape[1] == 0 or iz == R(0) or oz == R(0):
        return R(1), R(1), R(0)
    side = 0 if (iz > R(0)) == (oz > R(0)) else 1
    surface_i, volume_i, lost_i = side_at(R, tables.sides, side, ix, iy, iz)
    surface_o, volume_o, lost_o = side_at(R, tables.sides, side, ox, oy, oz)
    return surface_i * surface_o, volume_i * volume_o, lost_i * lost_o * abs(iz)


@njit(**PART)
def conserving_value(R, tables, ix, iy, iz, ox, oy, oz):
    """(r, g, b) of the whole repeat: radiance per unit `L_i dwi`, on both sides of the cloth."""
    on_surface, on_volume, share = between_sides(R, tables, ix, iy, iz, ox, oy, oz)
    red, green, blue = conserving_single(R, tables, on_surface, on_volume, ix, iy, iz, ox, oy, oz)
    side = 0 if (iz > R(0)) == (oz > R(0)) else 1
    return (
        red + share * tables.strength[side, 0],
        green + share * tables.strength[side, 1],
        blue + share * tables.strength[side, 2],
    )


@njit(**PART)
def conserving_point_value(R, tables, place, ix, iy, iz, ox, oy, oz):
    """(r, g, b) at a `Place` on a thread, per area of thread; the mean over the repeat, with gaps
    as 0, is `conserving_value`."""
    on_surface, on_volume, share = between_sides(R, tables, ix, iy, iz, ox, oy, oz)
    red, green, blue = conserving_point_single(
        R, tables, place, on_surface, on_volume, ix, iy, iz, ox, oy, oz
    )
    side = 0 if (iz > R(0)) == (oz > R(0)) else 1
    share /= tables.covered
    return (
        red + share * tables.strength[side, 0],
        green + share * tables.strength[side, 1],
        blue + share * tables.strength[side, 2],
    )

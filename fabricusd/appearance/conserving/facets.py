"""Where the facets of a white cloth send light from each direction, as a matrix over directions.

Row w, column v of the matrix is what facets lit from w send to the directions about v, so that
`h(w) (matrix h)(w)` is the light that leaves at once when the law has the factor h. Facets are
drawn by the area that w sees of them, directions by the thread's sampler, and each draw is shared
between the 16 entries that `grid` interpolates it from: the product is then exact for the h that
kernels read.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.conserving.grid import beyond, cell, cubic_weight, polar_angle
from fabricusd.appearance.conserving.single import (
    NODE_COS,
    NODE_SIN,
    NODE_WEIGHT,
    ConservingTables,
    facing,
    single_tables,
    visible,
)
from fabricusd.appearance.frame import from_thread, to_thread
from fabricusd.appearance.scattering.models.conserving import tabulated
from fabricusd.appearance.scattering.sampling import density, sample_direction
from fabricusd.appearance.scattering.terms import terms
from fabricusd.appearance.weave.coverage import WARP, WEFT
from fabricusd.appearance.weave.curve import is_pile
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import INLINE, KERNEL, PART

Floats = NDArray[np.float64]

WOVEN_TABLE = (25, 24, 8192)
PILE_TABLE = (25, 72, 4096)
"""Number of polar angles from N to the horizon, of azimuths over a full turn, and of points of the
low-discrepancy sequence per entry. Pile has a ridge a few degrees wide in azimuth, at which 36
azimuths are wrong by 1 %. Pile scatters a tenth as much light once as woven cloth does, so fewer
points give the same absolute error."""
HORIZON = 1e-3
"""N.w at which the last row is measured; it stands for the limit at the horizon."""

SURFACE, VOLUME = 0, 1
"""Terms of `Facets.sent`."""


class Facets(NamedTuple):
    """What the facets of white `conserving` cloth do with light, at the entries of a table.

    shape : (rows, columns) of the table
    sent : (entries, 2, 2, bins) float32 - from each entry, by side (own, other) and term, to each
        entry; summed over all entries, bins = 1, for pile
    surface : (entries,) float32 - share of the light on the facets that their surfaces reflect
    """

    shape: tuple[int, int]
    sent: NDArray[np.float32]
    surface: NDArray[np.float32]


def white_facets(fabric: Fabric, draws: int = 0) -> Facets:
    """The facets of `fabric` as if all of its threads were white and `conserving`.

    Opaque cloth is measured as if it transmitted light. The arrays are read-only: fabrics that
    differ in colour alone, and both precisions of a law, share them. draws : points per entry; 0
    takes the default
    """
    return _kept_facets(white(fabric), draws)


@lru_cache(maxsize=8)
def _kept_facets(fabric: Fabric, draws: int) -> Facets:
    pile = any(is_pile(t.curve) for t in fabric.thread_list)
    rows, columns, default = PILE_TABLE if pile else WOVEN_TABLE
    entries = rows * columns
    sent = np.zeros((entries, 2, 2, 1 if pile else entries), np.float32)
    surface = np.zeros(entries, np.float32)
    _measure(np.float32, white_tables(fabric), draws or default, columns, sent, surface)
    sent.flags.writeable = surface.flags.writeable = False
    return Facets((rows, columns), sent, surface)


def white_tables(fabric: Fabric) -> ConservingTables:
    """Float32 tables of `fabric` with white `conserving` threads only."""
    return single_tables(white(fabric), precision=np.float32)


def white(fabric: Fabric) -> Fabric:
    """`fabric` with white `conserving` threads, and without what its facets do not depend on."""
    threads = {
        k: replace(t, albedo=(1, 1, 1), color=(0.5, 0.5, 0.5), model="")
        for k, t in fabric.threads.items()
    }
    return replace(fabric, name="White", threads=threads, model="conserving", back=None)


def surface_shares(fabric: Fabric, w: Floats) -> Floats:
    """(n,) share of the light from each direction (n, 3) that the facets' surfaces reflect."""
    out = np.zeros(len(w), np.float32)
    _surfaces(np.float32, white_tables(fabric), w.astype(np.float32), out)
    return out.astype(np.float64)


@njit(**KERNEL)
def _surfaces(R: Any, tables: ConservingTables, w: Any, out: Any) -> None:
    for k in range(len(w)):
        _, out[k] = _seen_facets(R, tables, w[k, 0], w[k, 1], w[k, 2])


@njit(**KERNEL, parallel=True)
def _measure(R: Any, tables: Any, draws: int, columns: int, sent: Any, surface: Any) -> None:
    rows = surface.size // columns
    for entry in prange(surface.size):
        row, column = entry // columns, entry % columns
        z = max(math.cos(polar_angle(row / (rows - 1))), HORIZON)
        phi = 2.0 * math.pi * column / columns
        around = math.sqrt(1.0 - z * z)
        x, y = R(around * math.cos(phi)), R(around * math.sin(phi))
        total, surface[entry] = _seen_facets(R, tables, x, y, R(z))
        if total > 0.0:
            _send(R, tables, draws, total, rows, columns, x, y, R(z), sent[entry])


@njit(**PART)
def _seen_facets(R, tables, x, y, z):
    """(area of the facets that w above the cloth sees, share that their surfaces reflect)."""
    total, reflected = 0.0, 0.0
    for k in range(tables.nodes.shape[0]):
        here = _seen(R, tables, k, x, y, z)
        row = tables.threads[tables.node_thread[k]]
        warp = WARP if k >= tables.warp_start else WEFT
        c, s = tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN]
        along, _, _ = to_thread(R, warp, c, s, x, y, z)
        through, _ = tabulated(R, row, math.sqrt(max(R(0), R(1) - along * along)))
        total += here
        reflected += here * (1.0 - float(through))
    return total, (reflected / total if total > 0.0 else 0.0)


@njit(**INLINE)
def _seen(R, tables, k, x, y, z):
    """a q mu(w) of node k for w above the cloth."""
    along = y if k >= tables.warp_start else x
    mu = facing(R, R(1), tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN], along, z)
    return float(tables.nodes[k, NODE_WEIGHT] * mu)


@njit(**PART)
def _send(R, tables, draws, total, rows, columns, x, y, z, sent):
    """Add what leaves for light from (x, y, z), z > 0, to sent (2, 2, bins)."""
    scale = total * float(visible(R, tables, x, y, z)) / draws
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
        share = scale * float(seen * visible(R, tables, vx, vy, vz) * abs(vz) / p)
        if share > 0.0:
            side = 0 if vz > R(0) else 1
            _share_out(
                R, rows, columns, vx, vy, vz, share * surface, share * volume, sent[side],
            )  # fmt: skip


@njit(**PART)
def _share_out(R, rows, columns, x, y, z, surface, volume, sent):
    """Add both terms' light towards (x, y, z) to sent (2, bins), by the weights of `grid`."""
    if sent.shape[1] == 1:
        sent[0, 0] += surface
        sent[1, 0] += volume
        return
    if z < R(0):
        x, y, z = -x, -y, -z
    row, column, t, u = cell(R, rows, columns, x, y, z)
    for a in range(4):
        for b in range(4):
            i, j = beyond(rows, columns, row + a - 1, column + b - 1)
            weight = cubic_weight(R, a, t) * cubic_weight(R, b, u)
            sent[0, i * columns + j] += weight * surface
            sent[1, i * columns + j] += weight * volume

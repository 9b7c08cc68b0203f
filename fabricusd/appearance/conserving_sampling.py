"""Importance sampling of `conserving` cloth: directions over the whole sphere and their density.

A mixture. Part is uniform, over the sphere or, for opaque cloth, over the viewer's side; part is by
the cosine for what was scattered more than once, in proportion to it; the rest draws a facet in
proportion to how much of it the viewer sees, and then a direction by that thread's own sampler.
Facets are stretches of tangent angle with lobes as much wider as the angle varies inside; there are
a handful a fabric, since every one of them costs a term of the density.

Source: MODEL sections 6 and 7.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.conserving import (
    NODE_COS,
    NODE_SIN,
    NODE_WEIGHT,
    ConservingTables,
    facing,
)
from fabricusd.appearance.frame import WARP, WEFT, from_thread, to_thread
from fabricusd.appearance.multiple import lost_share, mean_albedo, mean_lost
from fabricusd.appearance.real import INLINE, LEAN, cos, sin
from fabricusd.appearance.thread_sampling import density, sample_direction
from fabricusd.appearance.thread_terms import GAMMA_SURFACE, GAMMA_VOLUME
from fabricusd.fabric import Fabric

Reals = NDArray[Any]

UNIFORM_SHARE = 0.15
"""Share of directions that are uniform: it bounds the weight of what no lobe expects."""
WIDEST_FACET = math.radians(15.0)
"""Tangent angles of one facet lie within this."""


class ConservingSampling(NamedTuple):
    """What the sampler reads; `real` is the tables' precision.

    rows : (f, COLUMNS) real - the facets' threads, lobes widened by the spread of tangent angle
    frames : (f, 2) real - cosine and sine of a facet's mean tangent angle
    starts : (f + 1,) int32 - facet f stands for the nodes starts[f] to starts[f + 1] - 1
    albedo : real - what a thread gives back of diffuse light, mean of the channels
    multiple : real - C of the multiple-scattering term, mean of the channels; 0 where it is off
    """

    rows: Reals
    frames: Reals
    starts: NDArray[np.int32]
    albedo: Any
    multiple: Any


def conserving_sampling(fabric: Fabric, tables: ConservingTables) -> ConservingSampling:
    """Facets of `fabric`, whose tables these are."""
    R = tables.nodes.dtype.type
    nodes = tables.nodes.astype(np.float64)
    psi0 = np.arctan2(nodes[:, NODE_SIN], nodes[:, NODE_COS])
    starts = [0]
    for k in range(1, len(psi0)):
        first = starts[-1]
        same = tables.node_thread[k] == tables.node_thread[first] and k != tables.warp_start
        if not same or psi0[k] - psi0[first] > WIDEST_FACET:
            starts.append(k)
    starts.append(len(psi0))
    rows, frames = [], []
    for first, last in pairwise(starts):
        weight = nodes[first:last, NODE_WEIGHT]
        weight = weight / max(weight.sum(), 1e-300)
        mean = float(weight @ psi0[first:last])
        variance = float(weight @ (psi0[first:last] - mean) ** 2)
        row = tables.threads[tables.node_thread[first]].astype(np.float64)
        for gamma in (GAMMA_SURFACE, GAMMA_VOLUME):
            # Turning a tangent by x moves the mirror direction by 2 x; lobes are 2 gamma wide.
            row[gamma] = math.hypot(row[gamma], math.sqrt(variance))
        rows.append(row)
        frames.append((math.cos(mean), math.sin(mean)))
    albedo = mean_albedo(fabric).mean()
    return ConservingSampling(
        rows=np.ascontiguousarray(rows, dtype=R),
        frames=np.ascontiguousarray(frames, dtype=R),
        starts=np.array(starts, np.int32),
        albedo=R(albedo),
        multiple=R(tables.strength.mean() * math.pi * mean_lost(tables)),
    )


@njit(**INLINE)
def facet_seen(R, tables, sampling, facet, x, y, z):  # type: ignore[no-untyped-def]
    """Sum of a q mu(w) over a facet's nodes, 0 where its thread does not scatter here."""
    first, last = sampling.starts[facet], sampling.starts[facet + 1]
    if tables.scatters[first] == 0:
        return R(0)
    side = R(1) if z > R(0) else R(-1)
    along = y if first >= tables.warp_start else x
    total = R(0)
    for k in range(first, last):
        c, s = tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN]
        total += tables.nodes[k, NODE_WEIGHT] * facing(R, side, c, s, along, z)
    return total


@njit(**INLINE)
def _shares(R, tables, sampling, ox, oy, oz):  # type: ignore[no-untyped-def]
    """(by the cosine, by facets): shares of the mixture for a viewer; uniform the rest."""
    rest = R(1 - UNIFORM_SHARE)
    if sampling.multiple == R(0):
        return R(0), rest
    m = lost_share(R, tables.lost, ox, oy, oz)
    twice = sampling.multiple * m
    once = sampling.albedo * max(tables.covered - m, R(0))
    share = rest * twice / max(twice + once, R(1e-20))
    return share, rest - share


@njit(**LEAN)
def conserving_density(R, tables, sampling, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """pdf(wi) [1/sr] of `sample_conserving` for the viewer wo."""
    by_cosine, by_facets = _shares(R, tables, sampling, ox, oy, oz)
    total, p = R(0), R(0)
    for facet in range(sampling.starts.size - 1):
        seen = facet_seen(R, tables, sampling, facet, ox, oy, oz)
        if seen > R(0):
            thread_set = WARP if sampling.starts[facet] >= tables.warp_start else WEFT
            c, s = sampling.frames[facet, 0], sampling.frames[facet, 1]
            a, b, d = to_thread(R, thread_set, c, s, ix, iy, iz)
            e, f, g = to_thread(R, thread_set, c, s, ox, oy, oz)
            total += seen
            p += seen * density(R, sampling.rows[facet], a, b, d, e, f, g)
    even = R(1) - by_cosine - by_facets
    if total > R(0):
        p = by_facets * p / total
    else:
        # No facet is seen, at the horizon of level threads: their share is uniform too.
        even += by_facets
    same = (iz > R(0)) == (oz > R(0))
    if tables.opaque != 0:
        p += (even * R(0.5 / math.pi)) if same else R(0)
    else:
        p += even * R(0.25 / math.pi)
    side = R(1) - tables.forward if same else tables.forward
    return p + by_cosine * side * abs(iz) * R(1 / math.pi)


@njit(**LEAN)
def sample_conserving(R, tables, sampling, ox, oy, oz, u0, u1, u2):  # type: ignore[no-untyped-def]
    """wi in the surface frame for three numbers in [0, 1): component and facet, and two more."""
    by_cosine, by_facets = _shares(R, tables, sampling, ox, oy, oz)
    total = R(0)
    for facet in range(sampling.starts.size - 1):
        total += facet_seen(R, tables, sampling, facet, ox, oy, oz)
    side = R(1) if oz > R(0) else R(-1)
    if u0 >= by_facets or total == R(0):
        turn = R(2 * math.pi) * u2
        v = (u0 - by_facets) / by_cosine if u0 >= by_facets and by_cosine > R(0) else R(2)
        if v < R(1):
            z = math.sqrt(u1)
            side = -side if v < tables.forward else side
        else:
            z = u1 if tables.opaque != 0 else R(2) * u1 - R(1)
        around = math.sqrt(max(R(1) - z * z, R(0)))
        return around * cos(R, turn), around * sin(R, turn), side * z
    v = u0 / by_facets
    below, seen = R(0), R(0)
    chosen = -1
    for facet in range(sampling.starts.size - 1):
        here = facet_seen(R, tables, sampling, facet, ox, oy, oz)
        if here > R(0) and (chosen < 0 or below + seen <= v * total):
            below += seen
            seen, chosen = here, facet
    thread_set = WARP if sampling.starts[chosen] >= tables.warp_start else WEFT
    c, s = sampling.frames[chosen, 0], sampling.frames[chosen, 1]
    a, b, d = to_thread(R, thread_set, c, s, ox, oy, oz)
    # What is left of v inside its facet is uniform again.
    again = min(max((v * total - below) / seen, R(0)), R(1))
    x, y, z = sample_direction(R, sampling.rows[chosen], a, b, d, again, u1, u2)
    return from_thread(R, thread_set, c, s, x, y, z)

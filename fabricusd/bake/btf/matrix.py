"""Compute the table that all three forms compress: positions in the repeat by pairs of directions.

An entry is the apparent BRDF of appearance level `weave`: radiance over irradiance [1/sr], without
the cosine of the light. Light comes from above: what cloth lets through is not in the table. At
that level the radiance depends on a position only through its thread
and tangent angle. The table is therefore a product: values at nodes of (set, thread, angle), times
the share of each node in a texel. All computations use the nodes, of which there are a few hundred
however large the repeat is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.bake.texels.law_values import cloth_law, law_values
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric, even

Floats = NDArray[np.float64]

RINGS = (
    (0.0, 1),
    (11.0, 6),
    (23.0, 12),
    (34.5, 18),
    (46.0, 24),
    (57.5, 30),
    (68.0, 30),
    (78.0, 30),
)
"""Inclination [degrees] and number of directions of each ring. There are 151 directions, as in
measured BTFs, and none at the horizon."""

INSIDE = 4
"""Samples along a texel's side."""

LARGEST = 2**22
"""Largest number of texels of a repeat."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Btf:
    """A table, stored as a product of two matrices.

    directions : (d, 3) unit vectors, of light and of view alike
    nodes : (d*d, 3, k) float32 - values by view * d + light, channel, node
    texels : (h*w, k) float32 - share of each node in a texel, row 0 at v = 0
    size : (h, w)
    per_thread : texels along a thread's pitch
    """

    fabric: Fabric
    directions: Floats
    nodes: NDArray[np.float32]
    texels: NDArray[np.float32]
    size: tuple[int, int]
    per_thread: int


def ring_directions(rings: tuple[tuple[float, int], ...] = RINGS) -> Floats:
    """(d, 3) unit vectors on rings, at uniform azimuths."""
    found = []
    for inclination, count in rings:
        theta = math.radians(inclination)
        for k in range(count):
            phi = 2.0 * math.pi * k / count
            found.append(
                (math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta))
            )
    return np.array(found)


def btf_of(fabric: Fabric, *, per_thread: int = 16, directions: Floats | None = None) -> Btf:
    """Compute the table of one repeat of `fabric` with `per_thread` texels along a thread's pitch.

    The table is to be repeated, so its threads are even.
    Raises FabricError if the repeat has too many texels, see `table_size`.
    """
    fabric = even(fabric)
    size = table_size(fabric, per_thread)
    chosen = ring_directions() if directions is None else directions
    keys, texels = _texels(fabric, size, per_thread)
    return Btf(
        fabric=fabric,
        directions=chosen,
        nodes=_nodes(fabric, keys, chosen),
        texels=texels,
        size=size,
        per_thread=per_thread,
    )


def table_size(fabric: Fabric, per_thread: int) -> tuple[int, int]:
    """(h, w) texels of a table. Raises FabricError if a repeat has more than LARGEST texels."""
    ends, picks = true_repeat(fabric)
    h, w = picks * per_thread, ends * per_thread
    if h * w > LARGEST:
        raise FabricError(
            fabric.name,
            f"has a repeat of {w} x {h} texels; it must have at most {LARGEST} texels for a BTF",
        )
    return h, w


def _spacing(fabric: Fabric) -> float:
    """Spacing of the nodes [rad]: a third of the narrowest lobe's width, at least half a degree."""
    narrowest = min(t.gamma_surface for t in fabric.thread_list)
    return max(narrowest / 3.0, math.radians(0.5))


def _texels(
    fabric: Fabric, size: tuple[int, int], per_thread: int
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """(k, 3) set, thread and angle index of each node in use; (texels, k) shares of the nodes."""
    step, types = _spacing(fabric), len(fabric.threads)
    count = 2 * math.ceil(0.5 * math.pi / step) + 1
    place = (np.arange(INSIDE) + 0.5) / INSIDE
    h, w = size
    shares: dict[int, NDArray[np.float32]] = {}
    for a in place:
        for b in place:
            x, y = np.meshgrid(np.arange(w) + a, np.arange(h) + b)
            uv = np.stack((x.ravel(), y.ravel()), axis=1) / per_thread
            hit = lookup(fabric, uv)
            at = hit.angle / step + (count - 1) / 2
            low = np.clip(np.floor(at).astype(np.int64), 0, count - 2)
            upper = at - low
            base = (hit.set.astype(np.int64) * types + hit.thread) * count
            seen = hit.set != GAP
            for offset, weight in ((0, 1.0 - upper), (1, upper)):
                key = base + low + offset
                for one in np.unique(key[seen & (weight > 1e-12)]):
                    mine = seen & (key == one)
                    column = shares.setdefault(int(one), np.zeros(h * w, np.float32))
                    column[mine] += (weight[mine] / INSIDE**2).astype(np.float32)
    used = sorted(shares)
    keys = np.array([(k // count // types, k // count % types, k % count) for k in used], np.int64)
    keys = keys.reshape(-1, 3)
    if not used:
        return keys, np.zeros((h * w, 0), np.float32)
    return keys, np.stack([shares[k] for k in used], axis=1)


def _nodes(fabric: Fabric, keys: NDArray[np.int64], directions: Floats) -> NDArray[np.float32]:
    """(d*d, 3, k) values at the nodes."""
    step, d = _spacing(fabric), len(directions)
    middle = math.ceil(0.5 * math.pi / step)
    law = cloth_law(fabric)
    view, light = np.divmod(np.arange(d * d), d)
    wi = np.ascontiguousarray(directions[light].T)
    wo = np.ascontiguousarray(directions[view].T)
    out = np.empty((d * d, 3, len(keys)), np.float32)
    for k, (which, thread, number) in enumerate(keys):
        angle = min(max((number - middle) * step, -0.5 * math.pi), 0.5 * math.pi)
        values = law_values(law, int(which), int(thread), np.full(d * d, angle), wi, wo)
        out[:, :, k] = (values / wi[2]).T
    return out


def table(btf: Btf, rows: NDArray[Any], texels: NDArray[Any]) -> Floats:
    """(n, 3) entries of the table at the direction pairs `rows` (n,) and `texels` (n,)."""
    return np.asarray(
        np.einsum("nck,nk->nc", btf.nodes[rows].astype(np.float64), btf.texels[texels])
    )

"""The tables that the kernels of the published law read: threads and the nodes on their curves."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.scattering.columns import LAW
from fabricusd.appearance.scattering.model import PUBLISHED
from fabricusd.appearance.scattering.models import model_of
from fabricusd.appearance.scattering.table import pack_threads
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.appearance.weave.quadrature import Rule, curve_nodes, default_rule
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric

Reals = NDArray[Any]
"""float32 or float64: the precision that the tables were made for."""

NODE_COS, NODE_SIN, NODE_WEIGHT, NODE_HALF = 0, 1, 2, 3
"""Columns of `SurfaceTables.nodes`: cosine and sine of the tangent angle, share of the cloth's
area, and half the range of angles [rad] over which the node's lobes are averaged."""

NARROWEST_MASKING = 1e-6
"""Least masking width [rad]: narrower ones are replaced by it, so that 1/width^2 stays finite."""


class SurfaceTables(NamedTuple):
    """Arrays of one fabric for the surface law; `real` is the precision asked for.

    threads : (k, COLUMNS) real - see `scattering.columns`
    nodes : (q, 4) real - NODE_ columns, weft nodes first, including those of conserving threads
    node_thread : (q,) int32
    published : (q,) uint8 - 1 where the node's thread has a published model
    warp_start : int - nodes from here on are warp
    gap : real - share of the cloth that no thread covers
    overlap_precision : real - 2/masking_width^2 [1/rad^2]
    """

    threads: Reals
    nodes: Reals
    node_thread: NDArray[np.int32]
    published: NDArray[np.uint8]
    warp_start: int
    gap: Any
    overlap_precision: Any


def surface_tables(
    fabric: Fabric,
    *,
    precision: type[np.floating[Any]] = np.float64,
    rule: Rule | None = None,
) -> SurfaceTables:
    """Tables of `fabric` in `precision`; `rule` None takes `quadrature.default_rule`."""
    if precision not in (np.float32, np.float64):
        raise FabricError("precision", f"is {precision!r}; it must be float32 or float64")
    cells = has_cell_lobes(fabric)
    q = curve_nodes(fabric, rule or default_rule(fabric, cells=cells))
    if not cells and q.half.any():
        raise FabricError(
            "rule",
            f"averages lobes over cells, but a model of {fabric.name} has no formula for such a "
            "mean; the form of the rule must be points",
        )
    threads = pack_threads(fabric, np.float64)
    width = max(fabric.masking_width, NARROWEST_MASKING)
    nodes = np.stack((np.cos(q.psi0), np.sin(q.psi0), q.weight, q.half), axis=1)
    return SurfaceTables(
        threads=threads.astype(precision),
        nodes=np.ascontiguousarray(nodes, dtype=precision),
        node_thread=q.thread,
        published=(threads[q.thread, LAW] == PUBLISHED).astype(np.uint8),
        warp_start=q.warp_start,
        gap=precision(coverage(fabric).gap),
        overlap_precision=precision(2.0 / width**2),
    )


def has_cell_lobes(fabric: Fabric) -> bool:
    """Whether every thread of the published law has a formula for the mean lobe over a cell."""
    models = [model_of(fabric, t) for t in fabric.thread_list]
    return all(m.cell_lobes is not None for m in models if m.law == PUBLISHED)

"""The tables that the kernels of the published law read: threads and the nodes on their curves."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.laws import law_of
from fabricusd.appearance.published.excess import excess_of
from fabricusd.appearance.scattering.columns import LAW
from fabricusd.appearance.scattering.model import PUBLISHED
from fabricusd.appearance.scattering.models import model_of
from fabricusd.appearance.scattering.table import pack_threads
from fabricusd.appearance.shadow.kinds import Shadow
from fabricusd.appearance.shadow.mean import node_means
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.appearance.weave.quadrature import Rule, curve_nodes, default_rule
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric

Reals = NDArray[Any]
"""float32 or float64: the precision that the tables were made for."""


class SurfaceTables(Protocol):
    """Arrays of one fabric for the surface law; `real` is the precision asked for.

    An instance of the law's `Law.tables`, which has these fields and the law's own.

    threads : (k, COLUMNS) real - see `scattering.columns`
    nodes : (q, 4) real - NODE_ columns, weft nodes first, including those of conserving threads
    node_thread : (q,) int32
    published : (q,) uint8 - 1 where the node's thread has a published model
    warp_start : int - nodes from here on are warp
    gap : real - share of the cloth that no thread covers
    """

    threads: Reals
    nodes: Reals
    node_thread: NDArray[np.int32]
    published: NDArray[np.uint8]
    warp_start: int
    gap: Any

    def _replace(self, **fields: Any) -> SurfaceTables: ...


def surface_tables(
    fabric: Fabric,
    *,
    precision: type[np.floating[Any]] = np.float64,
    rule: Rule | None = None,
    shadow: Shadow | None = None,
) -> SurfaceTables:
    """Tables of `fabric` in `precision`; `rule` None takes `quadrature.default_rule`.

    shadow : the shadowing whose mean level `far` holds, under laws that are `absolute`; None for
        light that nothing holds back
    """
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
    law = law_of(fabric)
    held = None
    if law.absolute and shadow is not None:
        held = node_means(shadow, q, fabric)
    nodes = np.stack((np.cos(q.psi0), np.sin(q.psi0), q.weight, q.half), axis=1)
    made: Any = law.tables(
        threads=threads.astype(precision),
        nodes=np.ascontiguousarray(nodes, dtype=precision),
        node_thread=q.thread,
        published=(threads[q.thread, LAW] == PUBLISHED).astype(np.uint8),
        warp_start=q.warp_start,
        gap=precision(coverage(fabric).gap),
        **law.make(fabric, q, held, precision),
    )
    if not law.absolute:
        return made
    excess = excess_of(made, precision)
    if not (excess > 1.0).any():
        return made
    return made._replace(excess=made.excess * excess.astype(precision).reshape(-1))


def has_cell_lobes(fabric: Fabric) -> bool:
    """Whether every thread of the published law has a formula for the mean lobe over a cell."""
    models = [model_of(fabric, t) for t in fabric.thread_list]
    return all(m.cell_lobes is not None for m in models if m.law == PUBLISHED)

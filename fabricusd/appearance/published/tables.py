"""What the surface kernels read of a fabric: its threads and the nodes over their curves."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.scattering.table import pack_threads
from fabricusd.appearance.scattering.terms import (
    CONSERVING,
    MODEL,
    SURFACE_GAUSSIAN,
    VOLUME_GAUSSIAN,
)
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.appearance.weave.quadrature import Rule, curve_nodes, default_rule
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric

Reals = NDArray[Any]
"""float32 or float64, by the precision that the tables were made for."""

NODE_COS, NODE_SIN, NODE_WEIGHT, NODE_HALF = 0, 1, 2, 3
"""Columns of `SurfaceTables.nodes`: cosine and sine of the tangent angle, share of the cloth's
area, half the stretch of angle that the node's lobes are averaged over [rad]."""

NARROWEST_MASKING = 1e-6
"""Masking width below which `u` is taken as this wide [rad], so that 1/width^2 stays finite."""


class SurfaceTables(NamedTuple):
    """Arrays of one fabric for the surface law; `real` is the precision asked for.

    threads : (k, COLUMNS) real - see `thread_terms`
    smooth : (k, COLUMNS) real - the same with both lobes replaced by 1: the factors beside them
    nodes : (q, 4) real - NODE_ columns, weft nodes first; those of `conserving` threads included
    node_thread : (q,) int32
    published : (q,) uint8 - 1 where the node's thread has a published model
    warp_start : int - nodes from here on are warp
    gap : real - share that no thread covers
    overlap_precision : real - 2/masking_width^2 [1/rad^2]
    """

    threads: Reals
    smooth: Reals
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
    q = curve_nodes(fabric, rule or default_rule(fabric))
    threads = pack_threads(fabric, np.float64)
    smooth = threads.copy()
    for first in (SURFACE_GAUSSIAN, VOLUME_GAUSSIAN):
        # g(x) = norm exp(-half_precision x^2) = 1
        smooth[:, first : first + 2] = (0.0, 1.0)
    width = max(fabric.masking_width, NARROWEST_MASKING)
    nodes = np.stack((np.cos(q.psi0), np.sin(q.psi0), q.weight, q.half), axis=1)
    return SurfaceTables(
        threads=threads.astype(precision),
        smooth=smooth.astype(precision),
        nodes=np.ascontiguousarray(nodes, dtype=precision),
        node_thread=q.thread,
        published=(threads[q.thread, MODEL] != CONSERVING).astype(np.uint8),
        warp_start=q.warp_start,
        gap=precision(coverage(fabric).gap),
        overlap_precision=precision(2.0 / width**2),
    )

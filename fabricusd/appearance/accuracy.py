"""Choose the cheapest quadrature of level `far` whose measured error meets a bound."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.conserving.single import conserving_single, single_tables
from fabricusd.appearance.published.far import far_values
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.scattering.models import any_conserving, model_of
from fabricusd.appearance.weave.quadrature import (
    CANDIDATES,
    MOST_NODES_EVER,
    POINTS,
    REFERENCES,
    Rule,
    count_nodes,
    curve_nodes,
)
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import KERNEL

Floats = NDArray[np.float64]

PAIRS = 4096
"""Number of pairs of directions over which an error is measured."""

MARGIN = 1.5
"""Factor by which a measured error must stay below the bound. With PAIRS pairs, half of the error
of the narrowest lobes may lie in directions that no pair samples."""


class Accuracy(NamedTuple):
    """A rule, its measured mean error, and the cost of an evaluation in nodes."""

    rule: Rule
    error: float
    cost: float


def spread_pairs(count: int) -> tuple[Floats, Floats]:
    """Two (3, count) sets of directions in the upper hemisphere, whose pairs fill the four
    dimensions evenly."""
    # The Kronecker sequence of the generalised golden ratio in four dimensions.
    root = 1.1673039782614187
    points = (0.5 + np.arange(1, count + 1)[:, None] * root ** -np.arange(1.0, 5.0)) % 1.0

    def upper(u: Floats, v: Floats) -> Floats:
        flat = np.sqrt(1.0 - u * u)
        return np.stack((flat * np.cos(2 * np.pi * v), flat * np.sin(2 * np.pi * v), u))

    return upper(points[:, 0], points[:, 1]), upper(points[:, 2], points[:, 3])


def measure_rule(fabric: Fabric, rule: Rule, pairs: int = PAIRS) -> Accuracy:
    """Mean absolute error of `rule` over pairs of directions, relative to the mean value.

    The error is measured in float64 against a much finer quadrature, over all models of the fabric
    together.
    """
    reference = _reference(fabric, pairs)
    found = _far(fabric, rule, pairs)
    mean = float(reference.mean())
    error = float(np.abs(found - reference).mean()) / mean if mean > 0 else 0.0
    return Accuracy(rule, error, curve_nodes(fabric, rule).cost)


@lru_cache(maxsize=64)
def choose_rule(fabric: Fabric, max_error: float) -> Rule:
    """The cheapest candidate whose mean error on `fabric` is at most `max_error`.

    Raises `FabricError` if no candidate meets the bound.
    """
    if not max_error > 0:
        raise FabricError("max_error", f"is {max_error}; it must be above 0")
    best: Accuracy | None = None
    affordable = [r for r in _candidates(fabric) if count_nodes(fabric, r) <= MOST_NODES_EVER]
    for rule in sorted(affordable, key=lambda r: curve_nodes(fabric, r).cost):
        measured = measure_rule(fabric, rule)
        if MARGIN * measured.error <= max_error:
            return rule
        if best is None or measured.error < best.error:
            best = measured
    reached = MARGIN * best.error if best else 0.0
    raise FabricError(
        "max_error", f"is {max_error:g}; the finest quadrature of this fabric reaches {reached:.2g}"
    )


def _points_only(fabric: Fabric) -> bool:
    return any(model_of(fabric, t).cell_lobes is None for t in fabric.thread_list)


def _candidates(fabric: Fabric) -> list[Rule]:
    """The rules that all models of the fabric support: not every model has a mean over a cell."""
    points_only = _points_only(fabric)
    return [r for r in CANDIDATES if r.form == POINTS or not points_only]


@lru_cache(maxsize=8)
def _reference(fabric: Fabric, pairs: int) -> Floats:
    points, cells = REFERENCES
    few = count_nodes(fabric, points) <= 4 * MOST_NODES_EVER
    return _far(fabric, points if few or _points_only(fabric) else cells, pairs)


def _far(fabric: Fabric, rule: Rule, pairs: int) -> Floats:
    wi, wo = spread_pairs(pairs)
    out = np.zeros_like(wi)
    real: Any = np.float64
    far_values(real, surface_tables(fabric, precision=real, rule=rule), wi, wo, out, 0, pairs)
    if any_conserving(fabric):
        _add_single(real, single_tables(fabric, precision=real, rule=rule), wi, wo, out)
    return out


@njit(**KERNEL, parallel=True)
def _add_single(R, tables, wi, wo, out):  # type: ignore[no-untyped-def]
    for k in prange(wi.shape[1]):
        r, g, b = conserving_single(
            R, tables, R(1), R(1), wi[0, k], wi[1, k], wi[2, k], wo[0, k], wo[1, k], wo[2, k]
        )
        out[0, k] += r
        out[1, k] += g
        out[2, k] += b

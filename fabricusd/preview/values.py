"""Values of the surface laws in float32 for many directions at once, from a fabric's tables."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.fuzz import fuzz_over_all
from fabricusd.appearance.law import CONSERVING_ONLY, PUBLISHED_ONLY
from fabricusd.appearance.levels import FAR, LEVELS, THREAD
from fabricusd.appearance.shadow.methods import lit_all
from fabricusd.appearance.surface import conserving_all, far_all, points_all
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.appearance.weave.lookup import WeaveHit, lookup
from fabricusd.appearance.weave.place import Places

REAL: Any = np.float32
Reals = NDArray[np.float32]

_NOWHERE = Places(
    np.zeros(1, np.uint8), np.zeros(1, np.int32), np.zeros(1, REAL), np.zeros(1, REAL),
    np.zeros(0, REAL),
)  # fmt: skip


def value_far(tables: Any, wi: Reals, wo: Reals) -> Reals:
    """(3, n) radiance per unit `L_i dwi` at level `far`, cosine included; wi, wo : (3, n).

    tables : a `tables.Tables`
    """
    out = np.zeros_like(wi)
    if tables.kind != CONSERVING_ONLY:
        far_all(REAL, tables.published, wi, wo, out)
    if tables.kind != PUBLISHED_ONLY:
        conserving_all(REAL, tables.conserving, FAR, _NOWHERE, wi, wo, out)
    _under_fuzz(tables, np.full(1, len(tables.published.threads)), wi, wo, out)
    return out


def look_up(tables: Any, uv: NDArray[np.float64]) -> WeaveHit:
    """The threads at weave coordinates uv (n, 2), uneven where they are."""
    return lookup(tables.cloth, uv, tables.yarn)


def value_near(tables: Any, level: str, hit: WeaveHit, wi: Reals, wo: Reals) -> Reals:
    """(3, n) values at level `weave` or `thread` at n places, shadowed by their neighbours."""
    out = np.zeros_like(wi)
    number = LEVELS.index(level)
    if tables.kind != CONSERVING_ONLY:
        points_all(REAL, tables.published, number == THREAD, hit.places, wi, wo, out)
    if tables.kind != PUBLISHED_ONLY:
        conserving_all(REAL, tables.conserving, number, hit.places, wi, wo, out)
    lit = np.empty(wi.shape[1], REAL)
    lit_all(REAL, tables.cloth, tables.shadow, True, hit.even_uv, wi, lit)
    out *= lit
    rows = np.where(hit.set == GAP, -1, hit.thread).astype(np.int64)
    _under_fuzz(tables, rows, wi, wo, out)
    return out


def _under_fuzz(tables: Any, rows: NDArray[np.int64], wi: Reals, wo: Reals, out: Reals) -> None:
    """Lay the fuzz over the values `out`; rows : of `Fuzz.phase`, see `surface.fuzz_rows`."""
    if tables.fuzz is not None:
        fuzz_over_all(REAL, *tables.fuzz, rows, wi, wo, out)

"""How far a law's values lie from the tubes': the figures that tests, charts and docs state."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.geometry.tables import Table
from fabricusd.quality.colors import delta_e_2000

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A law against the tubes, over some pairs of directions.

    error : mean absolute difference over the tubes' mean
    bias : mean difference over the tubes' mean
    delta_e : mean CIE 2000 difference of colours, where a white diffuser that faces the light is 1
    noise : standard error of the tubes' values, mean over mean: what no law can be told apart by
    """

    error: float
    bias: float
    delta_e: float
    noise: float


def judge(found: Table, value: Floats, pairs: NDArray[np.bool_] | None = None) -> Judged:
    """`value` against the table's, over the pairs chosen; the held-out ones if none are.

    value : (n, 3) - radiance per unit `L_i dwi` for all pairs of the table; pairs : (n,) bool
    """
    if value.shape != found.value.shape:
        raise FabricError("value", f"has shape {value.shape}; it must be {found.value.shape}")
    chosen = found.held_out if pairs is None else pairs
    truth, law = found.value[chosen].astype(np.float64), value[chosen]
    scale = float(truth.mean())
    return Judged(
        error=float(np.abs(law - truth).mean()) / scale,
        bias=float((law - truth).mean()) / scale,
        delta_e=float(delta_e_2000(math.pi * law, math.pi * truth).mean()),
        noise=float(found.error[chosen].mean()) / scale,
    )

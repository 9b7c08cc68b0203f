"""Factorise a table at the lowest rank that meets an error bound."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.btf.matrix import Btf, table
from fabricusd.errors import FabricError
from fabricusd.quality.colors import delta_e_2000

Floats = NDArray[np.float64]

Decomposed = list[tuple[Floats, Floats, Floats]]
"""Left vectors (d*d, channels, r), singular values (r,), right vectors (r, texels), by group."""

SAMPLES = 4096
"""Number of entries of the table that an error is measured on."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Factors:
    """Factors of a table = rows @ columns.T, jointly for all channels or for each of them.

    rows : one array (d*d, 3, r) for joint factors, three (d*d, 1, r) otherwise
    columns : one array (h*w, r) or three; they include the singular values
    delta_e : mean CIE 2000 difference of the factors from the table, for the table's directions
    """

    rows: tuple[NDArray[np.float32], ...]
    columns: tuple[NDArray[np.float32], ...]
    delta_e: float

    @property
    def rank(self) -> int:
        """Largest number of components of any channel."""
        return max(int(c.shape[1]) for c in self.columns)


def factors(
    btf: Btf,
    *,
    joint: bool,
    max_error: float | None = None,
    rank: int = 0,
    full: Decomposed | None = None,
) -> Factors:
    """Return factors of `rank`, or if it is 0 of the lowest rank with delta E <= `max_error`.

    joint : one set of components for all channels; otherwise each channel has its own
    full : the result of `decomposed`, to reuse for several ranks

    The mean delta E 2000 is compared. Raises FabricError if the full rank does not meet the bound.
    """
    full = full or decomposed(btf, joint)
    most = max(len(s) for _, s, _ in full)
    rows, texels = _sampled(btf)
    true = _display(btf, rows, table(btf, rows, texels))

    def of_rank(r: int) -> Factors:
        cut = [(u[..., :r], (s[:r, None] * v[:r]).T) for u, s, v in full]
        made = Factors(
            rows=tuple(np.ascontiguousarray(u, np.float32) for u, _ in cut),
            columns=tuple(np.ascontiguousarray(c, np.float32) for _, c in cut),
            delta_e=0.0,
        )
        got = _display(btf, rows, entries(made, rows, texels))
        return Factors(
            rows=made.rows, columns=made.columns, delta_e=float(delta_e_2000(got, true).mean())
        )

    if rank:
        return of_rank(min(rank, most))
    if max_error is None or not max_error > 0:
        raise FabricError("max_error", f"is {max_error}; it must be above 0")
    low, high = 1, most
    best = of_rank(most)
    if best.delta_e > max_error:
        raise FabricError(
            "--max-error",
            f"is {max_error:g}; it must be at least {best.delta_e:.2g}, the error with all {most} "
            "components",
        )
    while low < high:
        middle = (low + high) // 2
        made = of_rank(middle)
        if made.delta_e <= max_error:
            high, best = middle, made
        else:
            low = middle + 1
    return best


def entries(made: Factors, rows: NDArray[np.int64], texels: NDArray[np.int64]) -> Floats:
    """(n, 3) entries of the product of the factors."""
    if len(made.rows) == 1:
        joint = made.rows[0][rows].astype(np.float64)
        return np.asarray(np.einsum("ncr,nr->nc", joint, made.columns[0][texels]))
    return np.stack(
        [
            np.einsum("nr,nr->n", u[rows, 0].astype(np.float64), c[texels])
            for u, c in zip(made.rows, made.columns, strict=True)
        ],
        axis=1,
    )


def decomposed(btf: Btf, joint: bool) -> Decomposed:
    """Compute the singular value decompositions from two small triangular matrices."""
    d2, channels, k = btf.nodes.shape
    if k == 0:
        empty = np.zeros((d2, channels if joint else 1, 1))
        zero = (empty, np.zeros(1), np.zeros((1, len(btf.texels))))
        return [zero] if joint else [zero] * channels
    q_texels, r_texels = np.linalg.qr(btf.texels.astype(np.float64))
    groups = [btf.nodes] if joint else [btf.nodes[:, c : c + 1] for c in range(channels)]
    found = []
    for nodes in groups:
        flat = nodes.reshape(-1, k).astype(np.float64)
        q_rows, r_rows = np.linalg.qr(flat)
        u, s, v = np.linalg.svd(r_rows @ r_texels.T)
        keep = max(1, int(np.count_nonzero(s > 1e-7 * s[0])))
        left = (q_rows @ u[:, :keep]).reshape(d2, -1, keep)
        found.append((left, s[:keep], v[:keep] @ q_texels.T))
    return found


def _sampled(btf: Btf) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    rng = np.random.default_rng(0)
    return (
        rng.integers(0, len(btf.nodes), SAMPLES),
        rng.integers(0, len(btf.texels), SAMPLES),
    )


def _display(btf: Btf, rows: NDArray[np.int64], values: Floats) -> Floats:
    """Convert apparent BRDFs to display colours: a perfect white is 1."""
    return np.clip(values * math.pi, 0.0, 1.0)

"""Check a BTF that was read from a file in any form: its parts must be valid and consistent."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.btf.factors import Factors
from fabricusd.errors import FabricError, one_line

FEWEST_DIRECTIONS = 3
"""Directions of a BTF at least: interpolation needs a triangle."""


@contextmanager
def damage_in(where: str, kind: str) -> Iterator[None]:
    """Convert any exception that a library raises for damaged bytes to a FabricError about `where`.

    MemoryError passes through: sizes must be checked before anything is read.
    """
    try:
        yield
    except (FabricError, MemoryError):
        raise
    except Exception as error:
        problem = f"is not {kind} or is damaged: {type(error).__name__}: {error}"
        raise FabricError(where, one_line(problem, 300)) from error


def require_finite(where: str, name: str, values: NDArray[Any]) -> None:
    """Raise FabricError, with their number, if any of `values` are NaN or infinite."""
    bad = int(np.count_nonzero(~np.isfinite(values)))
    if bad:
        raise FabricError(
            where, f"has {bad} of {values.size} {name} that are NaN or infinite; all must be finite"
        )


def require_whole(
    where: str, directions: NDArray[np.float64], made: Factors, size: tuple[int, int]
) -> None:
    """Raise FabricError if a BTF's parts have inconsistent shapes or values that are not finite.

    The shapes must be directions (d, 3), size (h, w), rows (d*d, channels, r), columns (h*w, r).
    """
    if directions.ndim != 2 or directions.shape[1] != 3 or len(directions) < FEWEST_DIRECTIONS:
        raise FabricError(
            where,
            f"has directions of shape {directions.shape}; it must have at least "
            f"{FEWEST_DIRECTIONS} of 3 numbers",
        )
    require_finite(where, "directions", directions)
    lengths = np.linalg.norm(directions, axis=1)
    wrong = (np.abs(lengths - 1.0) > 1e-3) | (directions[:, 2] < -1e-6)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise FabricError(
            f"{where} direction {k}",
            f"is {directions[k].tolist()}; it must be a unit vector above the cloth",
        )
    if min(size) < 1:
        raise FabricError(where, f"is {size[1]} x {size[0]} texels; it must have at least one")
    for rows, columns in zip(made.rows, made.columns, strict=True):
        channels = 3 // len(made.rows)
        rank = columns.shape[1] if columns.ndim == 2 else 0
        if rows.shape != (len(directions) ** 2, channels, rank) or rank < 1:
            raise FabricError(
                where,
                f"has rows of shape {rows.shape} beside columns of {columns.shape}; rows must be "
                f"({len(directions) ** 2}, {channels}, r), columns ({size[0] * size[1]}, r)",
            )
        if len(columns) != size[0] * size[1]:
            raise FabricError(
                where,
                f"has columns for {len(columns)} texels; it must have {size[0] * size[1]}, "
                f"{size[1]} x {size[0]}",
            )
        require_finite(where, "factors of directions", rows)
        require_finite(where, "factors of texels", columns)

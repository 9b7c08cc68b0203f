"""Tabulate texels by their phase in the repeat, so that each is computed once and then looked up.

A lay is a single affine map, so all texels of a mip level span the same area of the weave and
differ only in where their centre lies in the repeat: their phase. A table holds the texel at each
phase of a raster with FINEST (or at least COARSEST) steps per texel and PER_THREAD steps per
thread. A texel of the sheet takes the entry whose phase is nearest. A texel of a coarser level is
the mean of four texels of the next finer level, interpolated between its phases.

Uneven threads have no phase. A texel on them takes the entry of the place at which even threads
look as they do there: threads change over many texels, or not visibly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.bake.layout.garment import Garment, Lay
from fabricusd.bake.texels.maps import Texels, TextureMap
from fabricusd.bake.texels.moment_indices import MOMENTS
from fabricusd.bake.texels.moments import samples_for, spans_repeats, texels
from fabricusd.bake.texels.recipe import Recipe
from fabricusd.bake.texels.repeat import baked_repeat
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import LEAN

FINEST, COARSEST = 15, 9
"""Phases along a texel's side: its centre is located within 1/30, at worst 1/18 of a texel. Odd, so
that if the raster divides the thread's pitch, its centres lie on phases and not between two."""

PER_THREAD = 16
"""Phases along a thread's pitch if a texel spans several threads."""

FEWEST_SAMPLES, MOST_SAMPLES = 8, 32
"""Samples along a texel's side. A table can afford more of them than a sheet, for less noise."""

SAMPLES = 2**22
"""Samples of a table, unless FEWEST_SAMPLES require more: a third of a second."""

MOST_PHASES = 2**19
"""Largest number of phases in all tables of a garment: 210 MB of moments and maps."""

WORTH = 0.5
"""Largest cost of a table, relative to the samples of the sheet itself."""


@dataclass(frozen=True, eq=False)
class CellLevel:
    """Texels of one level by phase: entry `b * counts[0] + a` is centred at phase (a, b) + 1/2.

    counts : phases along U and V
    moments : (MOMENTS, phases) float32
    """

    counts: tuple[int, int]
    moments: NDArray[np.float32]
    _values: dict[str, NDArray[Any]] = field(default_factory=dict)

    def values(self, one: TextureMap, recipe: Recipe, lay: Lay) -> NDArray[Any]:
        """(phases, channels) values, cached, of a map that depends on the moments alone."""
        if one.name not in self._values:
            texels = Texels.of_moments(self.moments, recipe, lay)
            self._values[one.name] = np.ascontiguousarray(one.function(texels), one.kind)
        return self._values[one.name]


@dataclass(frozen=True, eq=False)
class CellTable:
    """The levels of one lay on one sheet's raster, finest first."""

    levels: tuple[CellLevel, ...]


def tables_of(
    garment: Garment, recipes: Sequence[Recipe], resolution: int, levels: int
) -> tuple[CellTable | None, ...]:
    """Return each lay's table, or None if computing every texel separately is cheaper.

    Lays that differ only in their offset share a table.
    """
    made: dict[tuple[Fabric, bytes], CellTable | None] = {}
    rasters = rasters_of(garment, resolution)
    for lay, recipe, raster in zip(garment.lays, recipes, rasters, strict=True):
        key = (lay.fabric, lay.matrix.tobytes())
        if key not in made:
            made[key] = None
            if raster is not None:
                step, repeat = _step(lay, resolution), baked_repeat(lay.fabric)
                made[key] = cell_table(recipe, step, repeat, raster, levels)
    return tuple(made[lay.fabric, lay.matrix.tobytes()] for lay in garment.lays)


def rasters_of(garment: Garment, resolution: int) -> tuple[Raster | None, ...]:
    """Return the raster of each lay's table, or None if it gets no table."""
    left = MOST_PHASES
    found: dict[tuple[Fabric, bytes], Raster | None] = {}
    for lay in garment.lays:
        key = (lay.fabric, lay.matrix.tobytes())
        if key not in found:
            step = _step(lay, resolution)
            raster = affordable_raster(step, baked_repeat(lay.fabric), resolution**2, left)
            left -= 0 if raster is None else math.prod(raster.counts)
            found[key] = raster
    return tuple(found[lay.fabric, lay.matrix.tobytes()] for lay in garment.lays)


def _step(lay: Lay, resolution: int) -> NDArray[np.float64]:
    """(2, 2) threads that a texel spans."""
    return np.asarray(lay.matrix @ np.diag((1.0, -1.0)) / resolution)


class Raster(NamedTuple):
    """The raster of a table.

    steps : phases along a texel's side
    counts : phases along U and V
    side : samples along a texel's side
    """

    steps: int
    counts: tuple[int, int]
    side: int


def affordable_raster(
    step: NDArray[np.float64], repeat: tuple[int, int], texels: int, most: int
) -> Raster | None:
    """Return the finest raster of at most `most` phases; None if `texels` texels are cheaper."""
    worth = WORTH * texels * max(samples_for(step, repeat), 1) ** 2
    for steps in (FINEST, COARSEST):
        counts = phase_counts(step, repeat, steps)
        phases = math.prod(counts)
        side = min(max(math.isqrt(int(min(worth, SAMPLES) / phases)), FEWEST_SAMPLES), MOST_SAMPLES)
        if phases <= most and phases * side**2 <= worth:
            return Raster(steps, counts, side)
    return None


def phase_counts(step: NDArray[np.float64], repeat: tuple[int, int], steps: int) -> tuple[int, int]:
    """Phases along U and V, `steps` a texel; one where a texel takes the repeat's mean."""
    if spans_repeats(step, repeat):
        return 1, 1
    apart = np.minimum(np.abs(step).sum(axis=1) / steps, 1.0 / PER_THREAD)
    return math.ceil(repeat[0] / apart[0]), math.ceil(repeat[1] / apart[1])


def cell_table(
    recipe: Recipe,
    step: NDArray[np.float64],
    repeat: tuple[int, int],
    raster: Raster,
    levels: int,
) -> CellTable:
    """Compute a table whose finest texels span `step` (2, 2) threads, and its coarser levels."""
    found = [CellLevel(raster.counts, _finest(recipe, step, repeat, raster))]
    for _ in range(1, levels):
        counts = phase_counts(2.0 * step, repeat, raster.steps)
        found.append(CellLevel(counts, _coarser(found[-1], step, repeat, counts, recipe)))
        step = 2.0 * step
    return CellTable(tuple(found))


def _finest(
    recipe: Recipe, step: NDArray[np.float64], repeat: tuple[int, int], raster: Raster
) -> NDArray[np.float32]:
    """(MOMENTS, phases) moments of the finest level, from samples of the weave of even threads."""
    recipe = recipe._replace(uneven=0)
    counts = raster.counts
    moments = np.empty((MOMENTS, counts[1], counts[0]), np.float32)
    apart = np.diag(np.array(repeat) / np.array(counts))
    start = apart @ np.full(2, 0.5) - step @ np.full(2, 0.5)
    side = 0 if spans_repeats(step, repeat) else raster.side
    texels(
        recipe, apart, step, start, (0, 0), np.zeros(counts[::-1], np.int32), 0, side,
        np.empty(MOMENTS, np.float32), moments,
    )  # fmt: skip
    return moments.reshape(MOMENTS, -1)


def _coarser(
    finer: CellLevel,
    step: NDArray[np.float64],
    repeat: tuple[int, int],
    counts: tuple[int, int],
    recipe: Recipe,
) -> NDArray[np.float32]:
    """(MOMENTS, phases) moments as means of four texels of the `finer` level, which span `step`."""
    moments = np.empty((MOMENTS, counts[0] * counts[1]), np.float32)
    if counts == (1, 1):
        moments[:, 0] = recipe.mean
        return moments
    # Positions on the finer raster of the four texels that make up this level's first phase.
    scale = np.array(finer.counts) / np.array(repeat)
    apart = np.array(finer.counts) / np.array(counts)
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]])
    starts = (corners @ step.T) * scale + (0.5 * apart - 0.5)
    taps = [_taps(starts[:, k], apart[k], counts[k], finer.counts[k]) for k in range(2)]
    below = finer.moments.reshape(MOMENTS, finer.counts[1], finer.counts[0])
    _means_of_four(below, *taps[0], *taps[1], moments.reshape(MOMENTS, counts[1], counts[0]))
    return moments


def _taps(
    starts: NDArray[np.float64], apart: float, count: int, finer: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]:
    """(4, count) entries before and after each position on an axis, and weights of the latter."""
    place = starts[:, None] + apart * np.arange(count)
    low = np.floor(place)
    first = np.mod(low, finer).astype(np.int32)
    return first, (first + 1) % np.int32(finer), (place - low).astype(np.float32)


@njit(**LEAN)
def _means_of_four(  # type: ignore[no-untyped-def]
    finer, left, right, s, upper, lower, t, out
):
    """out[:, b, a]: mean over k of `finer` between left, right [k, a] and upper, lower [k, b]."""
    R = np.float32
    for p in range(out.shape[0]):
        for b in range(out.shape[1]):
            for a in range(out.shape[2]):
                out[p, b, a] = R(0)
            for k in range(left.shape[0]):
                j, n, f = upper[k, b], lower[k, b], t[k, b]
                for a in range(out.shape[2]):
                    i, m, e = left[k, a], right[k, a], s[k, a]
                    first = finer[p, j, i] + e * (finer[p, j, m] - finer[p, j, i])
                    second = finer[p, n, i] + e * (finer[p, n, m] - finer[p, n, i])
                    out[p, b, a] += R(0.25) * (first + f * (second - first))

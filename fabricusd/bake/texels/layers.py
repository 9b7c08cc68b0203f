"""Compute a square of texels of one lay, level by level.

There are two implementations of one interface. One computes every texel. The other looks texels up
by their phase, and computes only those that are cut by the border of the UV layout.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.coverage import GAP, WARP, WEFT
from fabricusd.appearance.weave.lookup import find, move_along
from fabricusd.bake.texels import moment_indices as m
from fabricusd.bake.texels import moments
from fabricusd.bake.texels.cell_table import CellLevel, CellTable
from fabricusd.bake.texels.maps import Texels, TextureMap
from fabricusd.bake.texels.moment_indices import MOMENTS
from fabricusd.bake.texels.recipe import Recipe
from fabricusd.bake.texels.repeat import baked_repeat
from fabricusd.bake.texels.sheet import Sheet, Window, texel_start, texel_step
from fabricusd.kernels.real import LEAN

Moments = NDArray[np.float32]

LOOKED_UP = -1
"""Stands for a column of own moments if the table holds the texel."""

NONE: Moments = np.empty((MOMENTS, 0), np.float32)


class Layer(Protocol):
    """Texels of one lay at one mip level.

    owned : (h, w) float32 - share of each texel that belongs to the lay
    """

    owned: NDArray[np.float32]

    def values(self, one: TextureMap, mine: NDArray[np.bool_] | None) -> NDArray[Any]:
        """(n, channels) values of a map for the texels in the mask `mine` (h, w), or for all."""

    def halved(self) -> Layer:
        """Return the next coarser level."""

    def moments_at(self, j: int, i: int) -> Moments:
        """(MOMENTS,) moments of one texel."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Centres:
    """The weave at the texels' centres.

    weave : (h, w, 2) weave coordinates, modulo the repeat: places of the even cloth that look as
        the centres do
    sets, threads : (h, w) thread set and thread type
    shades : (2, h, w) factor of the albedo of the weft and the warp there, whichever is seen
    """

    weave: NDArray[np.float64]
    sets: NDArray[np.uint8]
    threads: NDArray[np.int32]
    shades: NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """A square of texels of one lay.

    window : the texels at the finest level
    level : mip level, 0 the finest
    """

    sheet: Sheet
    lay: int
    window: Window
    level: int = 0

    @property
    def size(self) -> int:
        """Number of texels along a side."""
        return (self.window[2] - self.window[0]) >> self.level

    def halved(self) -> Place:
        """Return the same place one level coarser."""
        return Place(sheet=self.sheet, lay=self.lay, window=self.window, level=self.level + 1)

    @cached_property
    def centres(self) -> Centres:
        """The weave at the texels' centres."""
        n = self.size
        found = Centres(
            weave=np.empty((n, n, 2)),
            sets=np.empty((n, n), np.uint8),
            threads=np.empty((n, n), np.int32),
            shades=np.ones((2, n, n), np.float32),
        )
        repeat = true_repeat(self.sheet.garment.lays[self.lay].fabric)
        _centres(
            self.recipe, *self._raster(), np.array(repeat, np.float64),
            found.weave, found.sets, found.threads, found.shades,
        )  # fmt: skip
        return found

    @property
    def recipe(self) -> Recipe:
        """Of the lay's fabric."""
        return self.sheet.recipes[self.lay]

    def phases(self, counts: tuple[int, int]) -> NDArray[np.int32]:
        """(h, w) entries of a cell table with `counts` phases along U and V."""
        found = np.empty((self.size, self.size), np.int32)
        fabric = self.sheet.garment.lays[self.lay].fabric
        if self.recipe.uneven:
            places = self.centres.weave / np.array(true_repeat(fabric))
            steps = np.minimum((places * counts).astype(np.int32), np.array(counts) - 1)
            return np.asarray(steps[..., 1] * counts[0] + steps[..., 0], np.int32)
        repeat = np.array(baked_repeat(fabric), np.float64)
        _phases(*self._raster(), repeat, *counts, found)
        return found

    def _raster(self) -> tuple[NDArray[np.float64], ...]:
        """(2,) weave coordinates of the first texel's corner, (2, 2) step."""
        return (
            texel_start(self.sheet, self.lay, *self.window[:2]),
            texel_step(self.sheet, self.lay, 1 << self.level),
        )

    def texels(self, moments: Moments, mine: NDArray[np.bool_] | None) -> Texels:
        """Return the input of the maps' functions for the texels in the mask `mine`, or for all.

        moments : (MOMENTS, n) of these texels
        """
        lay = self.sheet.garment.lays[self.lay]
        chosen: Any = slice(None) if mine is None else mine
        return Texels(
            moments=moments,
            usual=self.sheet.recipes[self.lay].mean,
            along=lay.along,
            weave=self.centres.weave[chosen].reshape(-1, 2),
            hit=(self.centres.sets[chosen].ravel(), self.centres.threads[chosen].ravel()),
            types=len(lay.fabric.threads),
            lay=self.lay,
        )


class ComputedLayer:
    """A layer that stores the moments of every texel, (MOMENTS, h, w)."""

    def __init__(self, place: Place, moments: Moments, owned: NDArray[np.float32]) -> None:
        self.place, self.moments, self.owned = place, moments, owned

    @classmethod
    def finest(cls, place: Place, owned: NDArray[np.float32]) -> ComputedLayer:
        """Compute the moments from samples of the weave wherever `owned` is not 0."""
        sheet, lay = place.sheet, place.lay
        found = np.zeros((MOMENTS, *owned.shape), np.float32)
        step = texel_step(sheet, lay)
        side = moments.samples_for(step, baked_repeat(sheet.garment.lays[lay].fabric))
        start = texel_start(sheet, lay, *place.window[:2])
        moments.texels(
            sheet.recipes[lay], step, step, start, place.window[:2], owned.astype(np.int32), 1,
            side, np.empty(MOMENTS, np.float32), found,
        )  # fmt: skip
        return cls(place, found, owned)

    @classmethod
    def of_uneven(cls, place: Place, table: CellTable, owned: NDArray[np.float32]) -> ComputedLayer:
        """Take the moments of uneven threads from a table of even ones: each texel those of the
        place at which even threads look as they do there, with the shades of its own threads.

        Coarser levels are means of these: where threads are thick, more texels show them.
        """
        level, shades = table.levels[0], place.centres.shades.reshape(2, -1)
        found = level.moments[:, place.phases(level.counts).ravel()]
        parts = [found[m.SHARE + m.PARTS * k : m.SHARE + m.PARTS * (k + 1)] for k in range(2)]
        seen = np.stack([part.sum(axis=0) for part in parts])
        both = (seen * shades).sum(axis=0) / np.maximum(seen.sum(axis=0), np.float32(1e-6))
        found[m.VOLUME : m.VOLUME + 3] *= both
        for k in range(2):
            found[m.TINT + 3 * k : m.TINT + 3 * k + 3] *= shades[k]
        return cls(place, found.reshape(MOMENTS, *owned.shape), owned)

    def values(self, one: TextureMap, mine: NDArray[np.bool_] | None) -> NDArray[Any]:
        """(n, channels) of a map."""
        moments = self.moments.reshape(MOMENTS, -1) if mine is None else self.moments[:, mine]
        return one.function(self.place.texels(moments, mine))

    def halved(self) -> ComputedLayer:
        """The next coarser level."""
        return ComputedLayer(self.place.halved(), *moments.halve(self.moments, self.owned))

    def moments_at(self, j: int, i: int) -> Moments:
        """(MOMENTS,) of one texel."""
        return self.moments[:, j, i]


class TableLayer:
    """A layer whose texels are looked up by phase; partly owned texels have moments of their own.

    own : (MOMENTS, n) moments of the texels whose owned share is neither 0 nor 1, row by row
    """

    def __init__(
        self, place: Place, table: CellTable, owned: NDArray[np.float32], own: Moments = NONE
    ) -> None:
        self.place, self.table, self.owned, self.own = place, table, owned, own

    @cached_property
    def phases(self) -> NDArray[np.int32]:
        """(h, w) entries of the cell table."""
        return self.place.phases(self.cell.counts)

    @cached_property
    def rows(self) -> NDArray[np.int32]:
        """(h, w) columns of `own`, LOOKED_UP for texels without one."""
        return numbered(cut_texels(self.owned))

    @property
    def cell(self) -> CellLevel:
        """The level of the cell table."""
        return self.table.levels[self.place.level]

    def values(self, one: TextureMap, mine: NDArray[np.bool_] | None) -> NDArray[Any]:
        """(n, channels) of a map."""
        if one.exact:
            return one.function(self.place.texels(self.own, mine))
        lay, sheet = self.place.lay, self.place.sheet
        chosen: Any = slice(None) if mine is None else mine
        known = self.cell.values(one, sheet.recipes[lay], sheet.garment.lays[lay])
        found = _gathered(known, self.phases[chosen].ravel())
        if self.own.shape[1]:
            rows = self.rows[chosen].ravel()
            cut = rows != LOOKED_UP
            texels = Texels.of_moments(
                self.own[:, rows[cut]], sheet.recipes[lay], sheet.garment.lays[lay]
            )
            found[cut] = one.function(texels)
        return found

    def halved(self) -> TableLayer:
        """The next coarser level."""
        owned = shares(self.owned, 1)
        places = np.argwhere(cut_texels(owned))
        own = np.empty((MOMENTS, len(places)), np.float32)
        if len(places):
            _cut_moments(
                places, self.owned, self.rows, self.own, self.phases, self.cell.moments, own
            )
        return TableLayer(self.place.halved(), self.table, owned, own)

    def moments_at(self, j: int, i: int) -> Moments:
        """(MOMENTS,) of one texel."""
        row = self.rows[j, i]
        if row != LOOKED_UP:
            return self.own[:, row]
        return self.cell.moments[:, self.phases[j, i]]


def layer_of(place: Place, owned: NDArray[np.float32]) -> Layer:
    """Return the finest layer of a lay.

    owned : (h, w) float32 - 1 for the lay's texels, 0 elsewhere
    """
    table = place.sheet.tables[place.lay]
    if table is None:
        return ComputedLayer.finest(place, owned)
    if place.recipe.uneven:
        return ComputedLayer.of_uneven(place, table, owned)
    return TableLayer(place, table, owned)


def _gathered(known: NDArray[Any], phases: NDArray[np.int32]) -> NDArray[Any]:
    """(n, channels) rows of `known` (phases, channels); each row is copied as a single item."""
    channels = known.shape[1]
    packed = known.view(np.dtype((np.void, known.itemsize * channels))).ravel()
    return packed.take(phases).view(known.dtype).reshape(-1, channels)


def shares(owned: NDArray[np.float32], levels: int) -> NDArray[np.float32]:
    """(h, w) owned shares `levels` levels coarser; exact, since they are multiples of 1/4**k."""
    n, size = owned.shape[0] >> levels, 1 << levels
    return owned.reshape(n, size, n, size).mean(axis=(1, 3), dtype=np.float32)


def cut_texels(owned: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(h, w) mask of the texels that are partly owned."""
    return (owned > 0) & (owned < 1)


def numbered(cut: NDArray[np.bool_]) -> NDArray[np.int32]:
    """(h, w) running number of each texel in `cut`, row by row; LOOKED_UP elsewhere."""
    rows = np.full(cut.shape, LOOKED_UP, np.int32)
    rows[cut] = np.arange(np.count_nonzero(cut))
    return rows


@njit(**LEAN)
def _phases(start, step, repeat, along, down, out):  # type: ignore[no-untyped-def]
    """Write the phases of texels to out (h, w), for `along` phases along U and `down` along V.

    start, step, repeat : see `_centres`
    """
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            u = (start[0] + step[0, 0] * (i + 0.5) + step[0, 1] * (j + 0.5)) / repeat[0]
            v = (start[1] + step[1, 0] * (i + 0.5) + step[1, 1] * (j + 0.5)) / repeat[1]
            a = np.int32((u - np.floor(u)) * along)
            b = np.int32((v - np.floor(v)) * down)
            out[j, i] = min(b, down - 1) * along + min(a, along - 1)


@njit(**LEAN)
def _centres(  # type: ignore[no-untyped-def]
    made, start, step, repeat, weave, sets, threads, shades
):
    """Fill the arrays of `Centres`.

    start, step : as for `moments.texels`; repeat : (2,) float64
    """
    for j in range(sets.shape[0]):
        for i in range(sets.shape[1]):
            u = start[0] + step[0, 0] * (i + 0.5) + step[0, 1] * (j + 0.5)
            v = start[1] + step[1, 0] * (i + 0.5) + step[1, 1] * (j + 0.5)
            u, v, warp, weft = moments.laid_at(made, u, v, np.float32(0))
            shades[WEFT, j, i], shades[WARP, j, i] = weft.shade, warp.shade
            at_u, at_v = u, v
            u -= repeat[0] * np.floor(u / repeat[0])
            v -= repeat[1] * np.floor(v / repeat[1])
            which, thread, s, _, _, length = find(np.float32, made.cloth, u, v)
            if made.uneven != 0 and which != GAP and length > np.float32(0):
                seen, place = (warp, at_v) if which == WARP else (weft, at_u)
                moved, _, _ = move_along(
                    np.float32, made.cloth, made.yarn, which, thread, seen.number, s, length, place
                )
                u, v = (u, v + (moved - place)) if which == WARP else (u + (moved - place), v)
                u -= repeat[0] * np.floor(u / repeat[0])
                v -= repeat[1] * np.floor(v / repeat[1])
            weave[j, i, 0], weave[j, i, 1] = u, v
            sets[j, i], threads[j, i] = which, thread


@njit(**LEAN)
def _cut_moments(places, owned, rows, own, phases, table, out):  # type: ignore[no-untyped-def]
    """Compute moments of texels `places` (n, 2) from the owned parts of their four finer texels."""
    R = np.float32
    for k in range(places.shape[0]):
        weight = R(0)
        for p in range(out.shape[0]):
            out[p, k] = R(0)
        for q in range(4):
            j, i = 2 * places[k, 0] + q // 2, 2 * places[k, 1] + q % 2
            share, row = owned[j, i], rows[j, i]
            weight += share
            for p in range(out.shape[0]):
                value = own[p, row] if row >= 0 else table[p, phases[j, i]]
                out[p, k] += share * value
        for p in range(out.shape[0]):
            out[p, k] /= weight

"""Measure the error of a bake as the delta E 2000 of re-lit swatches.

A swatch is a block of texels. The loader re-lights it under pairs of directions, and the result is
compared with appearance level `weave` twice: at points, which tells whether the texels are fine
enough, and with the mean of level `weave` over each texel, which tells whether the stored values
are right. Colours are those of a display that shows a perfect white as 1: radiance times pi over
the cosine of the light.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.accuracy import spread_pairs
from fabricusd.appearance.scattering.models import translucent
from fabricusd.bake.error.relight import NEEDED, relight
from fabricusd.bake.layout.raster import NOBODY, owners
from fabricusd.bake.texels.blocks import bake_block
from fabricusd.bake.texels.law_values import LawAtPlaces
from fabricusd.bake.texels.maps import REGISTRY
from fabricusd.bake.texels.sheet import Sheet, texel_start, texel_step
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.quality.colors import delta_e_2000

Floats = NDArray[np.float64]

PAIRS = 32
"""Number of pairs of directions that an error is measured under."""

TEXELS, MEANS = 256, 128
"""Number of texels of a swatch that are compared at points, and over their area."""

INSIDE = 12
"""Samples along a texel's side from which its reference mean is computed."""

MARGIN = 2.0
"""Ratio of the stated bound to the largest measured mean: other pairs see other lobes. Of pairs
held back the worst was 1.77 of it, for shot silk at 1.5 texels a thread."""


@dataclass(frozen=True, kw_only=True)
class SwatchError:
    """The delta E 2000 of a swatch.

    point : mean over texels and pairs, against level `weave` at points
    texel : mean over texels and pairs, against the mean of level `weave` over each texel
    worst_pair : `texel` for the pair of directions with the largest error
    bound : the stated bound, see `bound_of`
    behind : `texel` for light from behind the cloth; None where none comes through
    """

    point: float
    texel: float
    worst_pair: float
    bound: float
    behind: float | None = None


def pairs_between(count: int, skip: int = 0) -> tuple[Floats, Floats]:
    """(count, 3) lights and viewers, 10 degrees or more above the cloth, after the first `skip`."""
    wi, wo = spread_pairs(8 * (count + skip) + 64)
    low = math.sin(math.radians(10.0))
    high = np.flatnonzero((wi[2] > low) & (wo[2] > low))[skip : skip + count]
    return wi[:, high].T.copy(), wo[:, high].T.copy()


def display(radiance: Floats, wi: Floats) -> Floats:
    """Display colours of (n, 3) radiance values, cosine included, under light wi (3,)."""
    return np.asarray(np.clip(radiance * (math.pi / abs(wi[2])), 0.0, 1.0))


def fullest_block(sheet: Sheet) -> tuple[int, int, int]:
    """Return (bx, by, lay): the block near the middle of the sheet that one lay covers best."""
    middle = sheet.across // 2
    best, found = -1, (middle, middle, 0)
    order = sorted(
        ((x, y) for x in range(sheet.across) for y in range(sheet.across)),
        key=lambda p: abs(p[0] - middle) + abs(p[1] - middle),
    )
    for x, y in order[:64]:
        owner, _ = owners(sheet.corners, sheet.garment.lay, sheet.window(x, y), 0, sheet.resolution)
        counts = np.bincount(owner[owner != NOBODY], minlength=len(sheet.garment.lays))
        if counts.max() > best:
            best, found = int(counts.max()), (x, y, int(counts.argmax()))
        if best == sheet.block_side**2:
            break
    return found


@dataclass(frozen=True, kw_only=True, eq=False)
class Swatch:
    """A sheet's fullest block at one mip level.

    block : (bx, by)
    lay : the lay that covers most of the block; only its texels are compared
    maps : (h, w, channels) by name
    """

    sheet: Sheet
    block: tuple[int, int]
    lay: int
    level: int
    maps: dict[str, NDArray[Any]]

    @property
    def mine(self) -> NDArray[np.bool_]:
        """(h, w) mask of the texels that belong to the lay."""
        return np.asarray(self.maps["lay"][..., 0] == self.lay)

    def texels(self, rng: np.random.Generator) -> NDArray[np.int64]:
        """(TEXELS, 2) rows and columns of random texels of the lay."""
        mine = np.argwhere(self.mine)
        if not len(mine):
            raise FabricError(
                self.sheet.garment.name, "covers no texel; bake it at a higher resolution"
            )
        return mine[rng.integers(0, len(mine), TEXELS)]


def swatch_of(sheet: Sheet, names: Collection[str], level: int = 0) -> Swatch:
    """Return a sheet's swatch with the maps `names`, computed as for a file."""
    bx, by, lay = fullest_block(sheet)
    maps = [REGISTRY[name] for name in {*names, "lay"}]
    found, _, _ = bake_block(sheet, maps, bx, by)
    return Swatch(
        sheet=sheet,
        block=(bx, by),
        lay=lay,
        level=level,
        maps={t.name: found[k][level] for k, t in enumerate(maps)},
    )


def swatch_error(
    sheet: Sheet, *, level: int = 0, pairs: tuple[Floats, Floats] | None = None, seed: int = 0
) -> SwatchError:
    """Return the error of a sheet at mip `level` with the most accurate choice of maps."""
    return swatch_errors(sheet, (NEEDED,), level=level, pairs=pairs, seed=seed)[0]


def bound_of(worst: float, margin: float = MARGIN) -> float:
    """Return the stated bound, given the largest mean delta E 2000 of any measured pair."""
    return margin * worst


def swatch_errors(
    sheet: Sheet,
    choices: Sequence[Sequence[str]],
    *,
    level: int = 0,
    pairs: tuple[Floats, Floats] | None = None,
    seed: int = 0,
    means: bool = True,
) -> list[SwatchError]:
    """Return the error of a sheet at mip `level` for each choice of maps, see `relight.RELIT`.

    means : False measures at points only, which is fast, and leaves the other figures 0
    """
    swatch = swatch_of(sheet, {name for names in choices for name in names}, level)
    rng = np.random.default_rng(seed)
    chosen = swatch.texels(rng)
    step = texel_step(sheet, swatch.lay, 1 << level)
    start = texel_start(sheet, swatch.lay, *(k * sheet.block_side for k in swatch.block))
    corner = chosen[:, None, ::-1]
    points = start + (corner + rng.random((TEXELS, 1, 2))) @ step.T
    strata = np.stack(np.meshgrid(np.arange(INSIDE), np.arange(INSIDE)), axis=-1).reshape(-1, 2)
    inside = (strata + rng.random((MEANS, INSIDE**2, 2))) / INSIDE
    areas = start + (corner[:MEANS] + inside) @ step.T
    texels = [{n: swatch.maps[n][chosen[:, 0], chosen[:, 1]] for n in names} for names in choices]
    fabric = sheet.garment.lays[swatch.lay].fabric
    lit = pairs or pairs_between(PAIRS)
    at_points = compared(texels, fabric, points, lit)
    of_texels = compared(texels, fabric, areas, lit) if means else np.zeros_like(at_points)
    behind: Sequence[float | None] = [None] * len(choices)
    if means and translucent(fabric):
        from_behind = lit[0] * (1.0, 1.0, -1.0), lit[1]
        behind = [float(e.mean()) for e in compared(texels, fabric, areas, from_behind)]
    return [
        SwatchError(
            point=float(point.mean()),
            texel=float(texel.mean()),
            worst_pair=float(texel.max()),
            bound=bound_of(float(texel.max())),
            behind=through,
        )
        for point, texel, through in zip(at_points, of_texels, behind, strict=True)
    ]


def compared(
    choices: Sequence[dict[str, NDArray[Any]]],
    fabric: Fabric,
    weave: Floats,
    pairs: tuple[Floats, Floats],
) -> Floats:
    """(choices, pairs) mean delta E of re-lit texels against level `weave`.

    choices : maps (n, ...) by name
    weave : (m, samples, 2) weave coordinates in the first m <= n texels
    """
    errors = np.zeros((len(choices), len(pairs[0])))
    n, samples = weave.shape[:2]
    cloth = LawAtPlaces(fabric, weave.reshape(-1, 2))
    for k, (wi, wo) in enumerate(zip(*pairs, strict=True)):
        true = cloth.values(wi, wo).reshape(n, samples, 3)
        mean = display(true.mean(axis=1), wi)
        for choice, texels in enumerate(choices):
            got = relight({name: a[:n] for name, a in texels.items()}, fabric, wi, wo)
            errors[choice, k] = delta_e_2000(display(got, wi), mean).mean()
    return errors

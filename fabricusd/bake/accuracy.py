"""How far a baked set is from the truth, in delta E 2000 of re-lit swatches.

A swatch is a block of texels; it is re-lit by the loader under pairs of directions, and compared
with appearance level `weave` twice: at points, which asks whether the texels are fine enough, and
with its mean over each texel, which asks whether they hold the right thing. Colours are those of a
display that shows a perfect white as 1: radiance times pi over the light's cosine.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.accuracy import spread_pairs
from fabricusd.appearance.surface import evaluate
from fabricusd.bake.blocks import bake_block
from fabricusd.bake.maps import REGISTRY
from fabricusd.bake.raster import NOBODY, owners
from fabricusd.bake.relight import NEEDED, relight
from fabricusd.bake.sheet import Sheet, texel_start, texel_step
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric

Floats = NDArray[np.float64]

PAIRS = 32
"""Pairs of directions that an error is measured under."""

TEXELS = 256
"""Texels of a swatch that are compared."""

INSIDE = 8
"""Samples along a texel's side that its true mean is taken from."""

MARGIN = 1.5
"""How far above the measured mean the stated bound lies: other pairs see other lobes."""


@dataclass(frozen=True, kw_only=True)
class SwatchError:
    """Mean delta E 2000 over texels and pairs, the worst pair's, and the bound that is stated.

    point : against level `weave` at points; texel : against its mean over each texel
    """

    point: float
    texel: float
    worst_pair: float
    bound: float

    def as_dict(self) -> dict[str, float]:
        """For JSON."""
        return asdict(self)


def pairs_between(count: int, skip: int = 0) -> tuple[Floats, Floats]:
    """(count, 3) lights and viewers, 10 degrees or more above the cloth; leaves out `skip`."""
    wi, wo = spread_pairs(8 * (count + skip) + 64)
    low = math.sin(math.radians(10.0))
    high = np.flatnonzero((wi[2] > low) & (wo[2] > low))[skip : skip + count]
    return wi[:, high].T.copy(), wo[:, high].T.copy()


def display(radiance: Floats, wi: Floats) -> Floats:
    """Colours of (n, 3) values, cosine included, under light wi (3,)."""
    return np.asarray(np.clip(radiance * (math.pi / wi[2]), 0.0, 1.0))


def delta_e(a: Floats, reference: Floats) -> Floats:
    """(n,) CIE 2000 colour difference of (n, 3) linear Rec. 709 display colours."""
    import colour

    space = colour.RGB_COLOURSPACES["ITU-R BT.709"]
    lab = [colour.XYZ_to_Lab(colour.RGB_to_XYZ(x, space), space.whitepoint) for x in (a, reference)]
    return np.asarray(colour.difference.delta_E_CIE2000(lab[0], lab[1]), np.float64)


def fullest_block(sheet: Sheet) -> tuple[int, int, int]:
    """(bx, by, lay) of the block near the middle that one lay covers most of."""
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
        if best == sheet.block**2:
            break
    return found


def swatch_error(
    sheet: Sheet, *, level: int = 0, pairs: tuple[Floats, Floats] | None = None, seed: int = 0
) -> SwatchError:
    """Error of a sheet's fullest block at mip `level`, computed as it would be written."""
    bx, by, lay = fullest_block(sheet)
    maps = [REGISTRY[name] for name in (*NEEDED, "lay")]
    found, _, _ = bake_block(sheet, maps, bx, by)
    at_level = {t.name: found[k][level] for k, t in enumerate(maps)}
    mine = np.argwhere(at_level["lay"][..., 0] == lay)
    if not len(mine):
        raise FabricError(sheet.garment.name, "covers no texel; bake it at a higher resolution")
    rng = np.random.default_rng(seed)
    chosen = mine[rng.integers(0, len(mine), TEXELS)]
    texels = {n: a[chosen[:, 0], chosen[:, 1]] for n, a in at_level.items()}
    step = texel_step(sheet, lay, 1 << level)
    start = texel_start(sheet, lay, bx * sheet.block, by * sheet.block)
    fabric = sheet.garment.lays[lay].fabric
    inside = (np.arange(INSIDE) + rng.random((TEXELS, 2, INSIDE))) / INSIDE
    x = chosen[:, 1, None, None] + inside[:, 0, :, None]
    y = chosen[:, 0, None, None] + inside[:, 1, None, :]
    x, y = np.broadcast_arrays(x, y)
    weave = start + np.stack((x, y), axis=-1) @ step.T
    return compare(texels, fabric, weave.reshape(TEXELS, -1, 2), pairs or pairs_between(PAIRS))


def compare(
    texels: dict[str, NDArray[Any]], fabric: Fabric, weave: Floats, pairs: tuple[Floats, Floats]
) -> SwatchError:
    """Error of texels (n, ...) that span weave coordinates (n, samples, 2)."""
    points, means = [], []
    n, samples = weave.shape[:2]
    for wi, wo in zip(*pairs, strict=True):
        got = display(relight(texels, fabric, wi, wo), wi)
        true = evaluate(
            fabric, np.repeat(wi[None], n * samples, axis=0), wo, weave.reshape(-1, 2), "weave"
        ).reshape(n, samples, 3)
        means.append(float(delta_e(got, display(true.mean(axis=1), wi)).mean()))
        points.append(float(delta_e(got, display(true[:, samples // 2], wi)).mean()))
    texel, point = float(np.mean(means)), float(np.mean(points))
    worst = float(np.max(means))
    return SwatchError(point=point, texel=texel, worst_pair=worst, bound=MARGIN * worst)

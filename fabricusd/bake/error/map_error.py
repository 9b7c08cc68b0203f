"""Measure the error of each map: from its number type, over texels, and between texels.

The reference is the same map of level `weave`, computed from a thousand samples over a texel and
from one sample at a point. Errors are root mean squares in the map's own unit: degrees for
directions, the share of wrong values for ids. They are weighted as the map specifies, so that for
example a colour in a gap does not count.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion

from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.bake.error.accuracy import TEXELS, swatch_of
from fabricusd.bake.texels.maps import Texels, TextureMap
from fabricusd.bake.texels.moment_indices import COVER, MOMENTS
from fabricusd.bake.texels.moments import texels, threads_under
from fabricusd.bake.texels.sheet import Sheet, texel_start, texel_step

Floats = NDArray[np.float64]

SAMPLES = 32
"""Samples along a texel's side for the reference mean."""


@dataclass(frozen=True, kw_only=True)
class MapError:
    """Root mean square errors of a map, in `unit`.

    rounding : error that the file's number type adds to exact means over texels
    texel : stored values against the exact means over texels
    point : stored values, interpolated linearly, against the map at points
    spread : standard deviation of the map at points, the scale to judge an error by
    """

    unit: str
    rounding: float
    texel: float
    point: float
    spread: float


def exact(
    sheet: Sheet, lay: int, x: Floats, y: Floats, size: float, samples: int = SAMPLES
) -> Texels:
    """Compute texels of side `size` centred at (x, y) on a sheet, both (n,) [texels].

    With `size` 0 they are points.
    """
    one, made = sheet.garment.lays[lay], sheet.recipes[lay]
    moments = np.zeros((MOMENTS, len(x)), np.float32)
    sums, owner = np.empty(MOMENTS, np.float32), np.zeros((1, 1), np.int32)
    step, weave = texel_step(sheet, lay) * size, np.empty((len(x), 2))
    out = np.empty((MOMENTS, 1, 1), np.float32)
    for k in range(len(x)):
        weave[k] = texel_start(sheet, lay, x[k], y[k])
        start = weave[k] - step @ np.full(2, 0.5)
        texels(made, step, step, start, (k, 0), owner, 0, samples if size else 1, sums, out)
        moments[:, k] = out[:, 0, 0]
    sets, threads = np.empty(len(x), np.uint8), np.empty(len(x), np.int32)
    threads_under(made, weave, sets, threads)
    weave = np.mod(weave, true_repeat(one.fabric))
    return Texels(
        moments=moments,
        usual=made.mean,
        along=one.along,
        weave=weave,
        hit=(sets, threads),
        types=len(one.fabric.threads),
        lay=lay,
    )


def map_errors(
    sheet: Sheet,
    maps: Sequence[TextureMap],
    stored: Callable[[TextureMap, NDArray[Any]], NDArray[Any]],
) -> dict[str, MapError]:
    """Return the error of each map on a sheet's swatch; empty if every texel is at the border.

    stored : rounds a map's values as the file format does
    """
    swatch = swatch_of(sheet, [one.name for one in maps])
    inside = np.argwhere(binary_erosion(swatch.mine, np.ones((3, 3))))
    if not len(inside):
        return {}
    rng = np.random.default_rng(0)
    places, lay = inside[rng.integers(0, len(inside), TEXELS)], swatch.lay
    corner = np.array(swatch.block[::-1]) * sheet.block_side
    y, x = places.T + 0.5 + corner[:, None]
    moved = rng.uniform(-0.5, 0.5, (2, len(places)))
    texel = exact(sheet, lay, x, y, 1.0)
    point = exact(sheet, lay, x + moved[0], y + moved[1], 0.0)
    repeat = np.array(true_repeat(sheet.garment.lays[lay].fabric), np.float64)
    found = {}
    for one in maps:
        true, there = (np.asarray(one.function(t), np.float64) for t in (texel, point))
        written = stored(one, swatch.maps[one.name])
        read = written[places[:, 0], places[:, 1]].astype(np.float64)
        between = read if one.exact else linear(written, places, moved)
        weight = _weights(one, point)
        middle = np.sum(weight * there, axis=0) / np.maximum(weight.sum(axis=0), 1e-12)
        middle = np.broadcast_to(middle, there.shape)
        pairs = ((stored(one, true), true, texel), (read, true, texel), (between, there, point))
        errors = [_rms(one, a, b, t, repeat) for a, b, t in (*pairs, (middle, there, point))]
        found[one.name] = MapError(
            unit="share wrong" if one.kind_of == "id" else one.unit,
            rounding=errors[0],
            texel=errors[1],
            point=errors[2],
            spread=errors[3],
        )
    return found


def linear(values: NDArray[Any], places: NDArray[np.int64], moved: Floats) -> Floats:
    """(n, c) linear interpolation of `values` (h, w, c) near the centres of texels `places` (n, 2).

    moved : (2, n) offsets from the centres, to the right and down [texels]
    """
    found = np.zeros((len(places), values.shape[2]))
    aside = np.where(moved < 0, -1, 1)
    for down in (0, 1):
        for right in (0, 1):
            weight = np.ones(len(places))
            for axis, on in ((0, right), (1, down)):
                share = np.abs(moved[axis])
                weight = weight * (share if on else 1.0 - share)
            j, i = places[:, 0] + down * aside[1], places[:, 1] + right * aside[0]
            found += weight[:, None] * values[j, i]
    return found


def _weights(one: TextureMap, t: Texels) -> Floats:
    """(n, 1) or (n, channels) weight of each value."""
    weight = t.moments[COVER] if one.weight is None else one.weight(t)
    return np.asarray(weight, np.float64).reshape(len(t.weave), -1)


def _rms(one: TextureMap, a: Floats, true: Floats, t: Texels, repeat: Floats) -> float:
    """Return the weighted root mean square difference of (n, c) values."""
    if one.kind_of in ("direction", "axis"):
        cosine = np.sum(a * true, axis=1) / np.maximum(
            np.linalg.norm(a, axis=1) * np.linalg.norm(true, axis=1), 1e-12
        )
        cosine = np.abs(cosine) if one.kind_of == "axis" else cosine
        off = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))[:, None]
    elif one.kind_of == "id":
        return float(np.mean(a != true))
    elif one.kind_of == "place":
        off = np.abs(a - true) % repeat
        off = np.minimum(off, repeat - off)
    else:
        off = np.abs(a - true)
    weight = np.broadcast_to(_weights(one, t), off.shape)
    total = float(weight.sum())
    return float(np.sqrt(np.sum(weight * off * off) / total)) if total > 0 else 0.0

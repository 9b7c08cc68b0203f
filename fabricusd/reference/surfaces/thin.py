"""The shader of thin sheets: a plain surface that also lets light through, scattered evenly.

The sheet is the Lambertian base of `preview` in both directions: what it reflects leaves on the
viewer's side, what it transmits on the other, and the specular layer on either side takes its share
first. It is the thin-walled subsurface of OpenPBR with all of its light going forwards.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import INLINE, KERNEL, whole
from fabricusd.reference.rays.wave import (
    BLOCK,
    CHANCE,
    F_PDF,
    GO,
    GO_PDF,
    KEEP,
    MATERIAL,
    PLACE,
    THREAD,
    WEIGHT,
    WI,
    WO,
    F,
)
from fabricusd.reference.surfaces.normal_map import end_below, turn_frames
from fabricusd.reference.surfaces.preview import (
    ALPHA_ROW,
    BLUE_ROW,
    GREEN_ROW,
    IOR,
    METALLIC_ROW,
    OPACITY_ROW,
    RED_ROW,
    ROWS,
    STEP,
    TRANSMISSION,
    TRANSMISSION_MAP,
    Layers,
    Surfaces,
    evaluate,
    fresnel,
    look_up,
    sample,
    texture_at,
)

R = np.float32
_PI = R(math.pi)


def is_thin(table: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(materials,) whether each row of `Surfaces.table` lets scattered light through."""
    constant = table[:, TRANSMISSION : TRANSMISSION + 3].any(axis=1)
    return np.asarray(constant | (table[:, TRANSMISSION_MAP] >= 0))


def shade_thin_mapped(surfaces: Surfaces, hits: Any, tags: Any, first: int, last: int) -> None:
    """`shade_thin` of a sheet with a normal map, as `normal_map.shade_mapped`."""
    own = np.empty((3, last - first), np.float32)
    turn_frames(surfaces, hits, tags, first, last, own)
    shade_thin(surfaces, hits, tags, first, last)
    end_below(hits, first, last, own)


@njit(**KERNEL)
def shade_thin(surfaces, hits, tags, first, last):
    """Evaluate and sample the sheet at hits `first` to before `last`, all of one material.

    Fills the same rows as `preview.shade_preview`.
    """
    first, last = whole(first), whole(last)
    block = np.empty(ROWS * STEP, np.float32)
    material = tags[MATERIAL, first]
    row = surfaces.table[material]
    f0 = (row[IOR] - R(1)) / (row[IOR] + R(1))
    f0 = f0 * f0
    for start in range(first, last, BLOCK):
        size = min(BLOCK, last - start)
        look_up(surfaces, material, hits, start, size, block)
        for x in range(size):
            sheet = row[TRANSMISSION], row[TRANSMISSION + 1], row[TRANSMISSION + 2]
            if row[TRANSMISSION_MAP] >= R(0):
                sheet = texture_at(
                    surfaces, int(row[TRANSMISSION_MAP]), hits[PLACE, start + x],
                    hits[PLACE + 1, start + x],
                )  # fmt: skip
            _shade_one(f0, sheet, hits, start + x, x, block)


@njit(**INLINE)
def _value(layers, sheet, forward, wo, wi):
    """f times cosine (r, g, b) and pdf of `wi`.

    forward : share of the samples of the base that go to the other side
    """
    red, green, blue, pdf = evaluate(layers, wo, wi)
    cosine = abs(wi[2])
    even = (R(1) - layers.share) * cosine / _PI
    if wi[2] > R(0):
        return red, green, blue, max(pdf - forward * even, R(0))
    f90 = min(R(50) * layers.f0, R(1))
    through = R(1) - max(fresnel(layers.f0, f90, wo[2]), fresnel(layers.f0, f90, cosine))
    scale = (R(1) - layers.metallic) * through * cosine / _PI
    if wo[2] <= R(0):
        return R(0), R(0), R(0), R(0)
    return scale * sheet[0], scale * sheet[1], scale * sheet[2], forward * even


@njit(**INLINE)
def _shade_one(f0, sheet, hits, h, x, block):
    red, green, blue = block[RED_ROW + x], block[GREEN_ROW + x], block[BLUE_ROW + x]
    metallic, alpha, opacity = block[METALLIC_ROW + x], block[ALPHA_ROW + x], block[OPACITY_ROW + x]
    wo = hits[WO, h], hits[WO + 1, h], hits[WO + 2, h]
    gloss = metallic + (R(1) - metallic) * fresnel(f0, min(R(50) * f0, R(1)), wo[2])
    back = max(red, max(green, blue)) * (R(1) - metallic)
    on = max(sheet[0], max(sheet[1], sheet[2])) * (R(1) - metallic)
    base = back + on
    share = gloss / max(gloss + base, R(1e-6))
    share = R(0) if gloss <= R(0) else min(max(share, R(0.1)), R(1))
    forward = on / max(base, R(1e-6))
    layers = Layers(red, green, blue, metallic, alpha, f0, share)
    fr, fg, fb, pdf = _value(
        layers, sheet, forward, wo, (hits[WI, h], hits[WI + 1, h], hits[WI + 2, h])
    )
    hits[F, h], hits[F + 1, h], hits[F + 2, h] = opacity * fr, opacity * fg, opacity * fb
    hits[F_PDF, h] = opacity * pdf
    u = hits[CHANCE, h]
    gx, gy, gz = sample(
        alpha, share, wo[0], wo[1], wo[2], u, hits[CHANCE + 1, h], hits[CHANCE + 2, h]
    )
    if u >= share and (u - share) < forward * (R(1) - share):
        gz = -gz
    wr, wg, wb, pdf = _value(layers, sheet, forward, wo, (gx, gy, gz))
    hits[GO, h], hits[GO + 1, h], hits[GO + 2, h] = gx, gy, gz
    inverse = R(1) / pdf if pdf > R(0) else R(0)
    hits[WEIGHT, h], hits[WEIGHT + 1, h] = wr * inverse, wg * inverse
    hits[WEIGHT + 2, h] = wb * inverse
    chance = hits[CHANCE + 3, h]
    straight = chance >= opacity
    hits[GO_PDF, h] = R(-1) if straight else opacity * pdf
    hits[CHANCE + 3, h] = chance if straight else chance / opacity
    hits[KEEP, h], hits[THREAD, h] = opacity, R(-1)

"""The textures of one repeat of even threads, for garments whose bake does not resolve threads."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.bake.texels import moment_indices as m
from fabricusd.bake.texels import moments
from fabricusd.bake.texels.moment_indices import MOMENTS, PARTS
from fabricusd.bake.texels.recipe import recipe
from fabricusd.fabric import Fabric
from fabricusd.materials.near.maps import Pixels, texel_pixels, tinted_sets
from fabricusd.materials.near.parts import COUNT, LEAST, Parts, Texels

Floats = NDArray[np.float64]

PER_THREAD, LARGEST = 40, 2048
"""Texels of a thread at least, and those along a side of a texture at most."""

FEWEST = 4
"""Texels of a thread below which a repeat is too large for a texture."""

SAMPLES = 4
"""Samples along each side of a texel."""


def fits(fabric: Fabric) -> bool:
    """Whether the repeat of a fabric fits into a texture."""
    return max(true_repeat(fabric)) * FEWEST <= LARGEST


def repeat_layers(fabric: Fabric) -> tuple[dict[str, Pixels], Parts]:
    """Return the textures (h, w, c) of a repeat, the first pick below, and the parts of it.

    The threads are even: what differs from repeat to repeat is not in them.
    """
    ends, picks = true_repeat(fabric)
    wanted = PER_THREAD * max(ends, picks)
    size = min(1 << (wanted - 1).bit_length(), LARGEST)
    made = recipe(fabric, back=False)._replace(uneven=0)
    step = np.array([[ends / size, 0.0], [0.0, -picks / size]])
    found = np.empty((MOMENTS, size, size), np.float32)
    moments.texels(
        made, step, step, np.array([0.0, float(picks)]), (0, 0), np.zeros((size, size), np.int32),
        0, SAMPLES, np.empty(MOMENTS, np.float32), found,
    )  # fmt: skip
    rows = found.reshape(MOMENTS, -1).astype(np.float64)
    share, first, second = (
        rows[start : start + COUNT].T for start in (m.SHARE, m.ANGLE, m.ANGLE_2)
    )
    total = share.mean(axis=0)
    angle = first.mean(axis=0) / np.maximum(total, 1e-12)
    lean = (first - share * angle).reshape(-1, 2, PARTS).sum(axis=2)
    spread = second - 2.0 * angle * first + share * angle**2
    spread = np.maximum(spread, 0.0).reshape(-1, 2, PARTS).sum(axis=2)
    tint = rows[m.TINT : m.TINT + 6].T.reshape(-1, 2, 3)
    sets = share.reshape(-1, 2, PARTS).sum(axis=2)
    color = tint.mean(axis=0) / np.maximum(sets.mean(axis=0), 1e-12)[:, None]
    tint = np.where(color > 1e-6, tint / np.where(color > 1e-6, color, 1.0), sets[:, :, None])
    texels = Texels(share=share, lean=lean, spread=spread, tint=tint)
    total = np.where(total > LEAST, total, 0.0)
    pixels = {
        name: one.reshape(size, size, -1)
        for name, one in texel_pixels(texels).items()
        if "tint" not in name or tinted_sets(fabric, even=True)
    }
    return pixels, Parts(share=total, angle=angle, spread=spread.mean(axis=0))

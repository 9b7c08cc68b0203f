"""A white card in the cloth's place: the lamp's power, its colour, and what the lens darkens."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fabricusd.errors import FabricError
from fabricusd.measure.flat.photograph import Photograph
from fabricusd.measure.flat.setup import Setup

Floats = NDArray[np.float64]

SMOOTH = 1 / 64
"""Share of a picture's side over which grain of the card is smoothed."""


def _expected(card: Photograph, setup: Setup, reflectance: float) -> Floats:
    """(h, w) light of a matte card under a lamp of gain 1."""
    wi, _, square = setup.pairs(setup.places(card.shape))
    return np.asarray((reflectance / math.pi * wi[:, 2] / square).reshape(card.shape))


def lamp_of(card: Photograph, setup: Setup, reflectance: float) -> float:
    """The gain of the lamp by which the card is as bright as it is, in the middle of it."""
    if not 0 < reflectance <= 1:
        raise FabricError(
            "--card-reflectance", f"is {reflectance:g}; it must be above 0, at most 1"
        )
    if card.saturated.mean() > 0.01:
        raise FabricError(
            f"'{card.name}'",
            f"is saturated in {card.saturated.mean():.0%} of its pixels; expose for the card",
        )
    h, w = card.shape
    part = slice(h * 3 // 8, h * 5 // 8), slice(w * 3 // 8, w * 5 // 8)
    return float(card.luminance[part].mean() / _expected(card, setup, reflectance)[part].mean())


def carded(
    photograph: Photograph, card: Photograph, setup: Setup, reflectance: float, gain: float
) -> Photograph:
    """The photograph as a white lamp of `gain` at its stated place would have lit it."""
    reach = SMOOTH * min(card.shape)
    # Both are smoothed alike, so that their gradients cancel, at the border too.
    seen = np.stack([gaussian_filter(card.linear[..., c], reach) for c in range(3)], axis=-1)
    wanted = gaussian_filter(gain * _expected(card, setup, reflectance), reach)
    return Photograph(
        name=photograph.name,
        linear=photograph.linear * wanted[..., None] / np.maximum(seen, 1e-4),
    )

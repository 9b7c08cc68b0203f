"""Table 3.2's words for a thread: how much light each term scatters back and forward, how sharply.

The thesis chose its words by eye from plots. No thresholds on a plain quantity give them all back:
spun threads of one surface roughness are called shiny and blurry there. Here one pair of thresholds
serves all four columns of each kind of word, and the misses are named.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.thread import split
from fabricusd.fabric import Thread
from fabricusd.measure.angles import DEGREE, direction

Floats = NDArray[np.float64]

COLUMNS = ("back surface", "back internal", "forward surface", "forward internal")
MAGNITUDES, SHAPES = ("low", "med", "high"), ("shiny", "glossy", "blurry")

INCIDENCES = (-60.0, -30.0, 0.0, 30.0, 60.0)
"""Of the columns of Figure 3.14, over which quantities are averaged [degrees]."""
STEP = 2.0
"""Spacing of the directions over which light is summed [degrees]."""

SHARE_BOUNDS = (0.19, 0.66)
"""Shares of a hemisphere's light, from which a term is med and high. Of all pairs, none misses
fewer of the table's words: 6 of 28 for the published threads."""
WIDTH_BOUNDS = (19.33, 26.2)
"""Standard deviations of the inclination of a term's light [degrees], from which it is glossy and
blurry; chosen in the same way, with 6 of 28 missed."""

TABLE_3_2 = MappingProxyType({
    "polyester_filament": ("high shiny", "low glossy", "high shiny", "low shiny"),
    "polyester_spun": ("med blurry", "med blurry", "med shiny", "med blurry"),
    "silk_filament": ("med shiny", "med glossy", "high shiny", "med shiny"),
    "silk_spun": ("low glossy", "med blurry", "med glossy", "med glossy"),
    "rayon_spun": ("med glossy", "med blurry", "med shiny", "low glossy"),
    "wool_spun": ("med blurry", "high blurry", "high glossy", "med blurry"),
    "linen_spun": ("low glossy", "high blurry", "high shiny", "med blurry"),
})  # fmt: skip
"""[Bisker2011] Table 3.2: thread -> the words of each of COLUMNS."""


def quantities(thread: Thread, model: str) -> tuple[Floats, Floats]:
    """((4,) share of its hemisphere's light, (4,) standard deviation of its inclination [degrees]).

    In the order of COLUMNS. Shares are of the flux, the mean of the channels; back is light within
    90 degrees of azimuth of the light's.
    """
    grid = np.meshgrid(
        np.arange(-89.0, 90.0, STEP) * DEGREE, np.arange(1.0, 180.0, STEP) * DEGREE, indexing="ij"
    )
    theta, phi = (angles.ravel() for angles in grid)
    wo = direction(theta, phi)
    # f_s cos(theta_o) per solid angle, whose element is cos(theta_o) dtheta dphi.
    weight = np.cos(theta) ** 2
    forward = phi > np.pi / 2
    shares, widths = [], []
    for incidence in INCIDENCES:
        wi = np.broadcast_to(direction(incidence * DEGREE, 0.0), wo.shape)
        terms = split(thread, wi, wo, model)
        light = [terms.surface * weight, terms.volume * weight * float(np.mean(thread.albedo))]
        for half in (~forward, forward):
            whole = sum(float(each[half].sum()) for each in light)
            for each in light:
                flux = each[half]
                total = float(flux.sum())
                middle = float((flux * theta[half]).sum()) / max(total, 1e-300)
                spread = float((flux * (theta[half] - middle) ** 2).sum()) / max(total, 1e-300)
                shares.append(total / max(whole, 1e-300))
                widths.append(np.sqrt(spread) / DEGREE)
    shape = (len(INCIDENCES), 4)
    return np.reshape(shares, shape).mean(axis=0), np.reshape(widths, shape).mean(axis=0)


def words(thread: Thread, model: str) -> tuple[str, ...]:
    """The words of each of COLUMNS, as in `TABLE_3_2`."""
    shares, widths = quantities(thread, model)
    return tuple(
        f"{MAGNITUDES[int(np.searchsorted(SHARE_BOUNDS, s, side='right'))]} "
        f"{SHAPES[int(np.searchsorted(WIDTH_BOUNDS, w, side='right'))]}"
        for s, w in zip(shares, widths, strict=True)
    )


def misses(found: tuple[str, ...], table: tuple[str, ...]) -> list[str]:
    """A line for each word that differs from the table's."""
    return [
        f"{column}: {mine}, the table says {its}"
        for column, both, wanted in zip(COLUMNS, found, table, strict=True)
        for mine, its in zip(both.split(), wanted.split(), strict=True)
        if mine != its
    ]


def described_words(thread: Thread, model: str) -> list[str]:
    """A line with the words, as `fit` prints it."""
    said = zip(COLUMNS, words(thread, model), strict=True)
    return ["words: " + "; ".join(f"{column} {word}" for column, word in said)]

"""The error of each level by the width of a pixel, from which level `auto` has to choose.

The truth is level `thread`, averaged over the pixel, a square rotated against the weave. Averaging
multiplies the spectrum of the cloth by that of the square, so errors are sums over the spectrum and
exact for pixels at any place: root mean squares over all places, relative to the cloth's mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.levels import LEVELS
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.footprint import DEFAULT, Limits, weights
from fabricusd.chart.cloth_picture import FINE, TURN, View, cloth_spectrum
from fabricusd.fabric import Fabric

Floats = NDArray[np.float64]
Direction = tuple[float, float, float]

WIDTHS = np.geomspace(0.02, 20.0, 121)
"""Widths of a pixel in threads: from 50 pixels per thread to 20 threads per pixel."""

LIGHTS: tuple[Direction, ...] = ((0.48, 0.36, 0.8), (-0.6, 0.0, 0.8), (0.0, 0.8, 0.6))
"""Directions to the lights under which a cloth is measured."""

TO_EYE: Direction = (0.0, -0.28, 0.96)


@dataclass(frozen=True, kw_only=True, eq=False)
class Zoom:
    """A cloth at a series of distances.

    widths : (k,) - width of a pixel [threads]
    products : (k, 3, 3) - for each pair of levels, the mean over all places of the product of their
        errors in a pixel, over the square of the cloth's mean
    inside : (k, 3) - standard deviation of a level's values within a pixel, over the cloth's mean
    weights : (k, 3) - probabilities with which `auto` takes the levels
    """

    widths: Floats
    products: Floats
    inside: Floats
    weights: Floats

    @property
    def errors(self) -> Floats:
        """(k, 3) errors of the levels, in the order of LEVELS; that of `thread` is 0."""
        return np.asarray(np.sqrt(np.einsum("kll->kl", self.products)), np.float64)

    @property
    def auto_errors(self) -> Floats:
        """(k,) errors of the expectation of `auto`, the mean over its choices."""
        square = np.einsum("kl,klm,km->k", self.weights, self.products, self.weights)
        return np.asarray(np.sqrt(np.maximum(square, 0.0)), np.float64)


def zoom(
    fabric: Fabric,
    widths: Floats,
    wi: Direction,
    wo: Direction,
    shadow: str = "horizon",
    limits: Limits = DEFAULT,
) -> Zoom:
    """The levels and `auto` at pixels of `widths` [threads], lit from wi and seen from wo."""
    view = View(fabric=fabric, wi=wi, wo=wo, a=1, b=0, shadow=shadow)
    spectra = np.stack([_spectrum(view, level) for level in LEVELS])
    mean = float(spectra[2, 0, 0].real)
    power = np.abs(spectra) ** 2 / mean**2
    missing = ((spectra - spectra[2]) / mean).reshape(3, -1)
    k = np.fft.fftfreq(FINE, 1.0 / FINE) / view.repeat
    v, u = np.meshgrid(k, k, indexing="ij")
    c, s = np.cos(TURN), np.sin(TURN)
    products, inside = np.empty((len(widths), 3, 3)), np.empty((len(widths), 3))
    for n, width in enumerate(widths):
        square = (np.sinc(width * (c * u + s * v)) * np.sinc(width * (c * v - s * u))) ** 2
        weighted = missing * square.ravel()
        products[n] = (weighted @ missing.conj().T).real
        inside[n] = np.sqrt(np.maximum((power * (1.0 - square)).sum(axis=(1, 2)), 0.0))
    extents = np.stack((widths, widths), axis=1)
    shares = weights(fabric, extents, limits)
    return Zoom(widths=widths, products=products, inside=inside, weights=shares)


def coarsest(fabric: Fabric, bounds: Sequence[float]) -> dict[str, list[list[float]]]:
    """Where each level may begin: "far" and "weave" -> list of [bound, limit], largest bound first.

    The limit of `far` is in repeats per pixel, that of `weave` in pixels per thread. At the limit
    and at every wider pixel, the error is within the bound under all LIGHTS, without shadows. A
    bound that is not met at any of WIDTHS is left out.
    """
    found = [zoom(fabric, WIDTHS, wi, TO_EYE, "none") for wi in LIGHTS]
    worst = np.max([z.errors for z in found], axis=0)
    repeat = max(true_repeat(fabric))
    limits: dict[str, list[list[float]]] = {"far": [], "weave": []}
    # Move a limit slightly beyond its width, so that the width itself is on the coarser side.
    in_units = {"far": 0.999 * WIDTHS / repeat, "weave": 1.001 / WIDTHS}
    for bound in sorted(bounds, reverse=True):
        for level, unit in in_units.items():
            over = np.flatnonzero(worst[:, LEVELS.index(level)] > bound)
            first = int(over[-1]) + 1 if len(over) else 0
            if first < len(WIDTHS):
                limits[level].append([bound, float(f"{unit[first]:.5g}")])
    return limits


def _spectrum(view: View, level: str) -> NDArray[np.complex128]:
    if level != "far":
        return cloth_spectrum(view, level)
    flat = np.zeros((FINE, FINE), np.complex128)
    flat[0, 0] = view.value(np.zeros((1, 2)), "far")[0]
    return flat

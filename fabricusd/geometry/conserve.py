"""A second opinion on the presets: their threads in `conserving`, as near as their brightness goes.

python -m fabricusd.geometry.conserve [NAME ...] prints, for each preset, the albedos with which
cloth of the same threads under the conserving law reflects what the preset does, and how far it
stays from it; --write makes them the variant `conserving` of the presets' variant set `appearance`.
Velvet has none: no brightness of its pile comes near (error 1.05).
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from fabricusd.appearance import surface
from fabricusd.fabric import MODELS, PILE_ANGLE, SURFACE_LAWS, Fabric
from fabricusd.geometry.nearest import CONSERVING, write_variant
from fabricusd.geometry.tables import directions
from fabricusd.quality.colors import delta_e_2000
from fabricusd.schema import load, published_names

Floats = NDArray[np.float64]

STEPS = 8
"""Most steps of Gauss and Newton; three to five are taken."""

CHANGE = 1e-3
"""Change of an albedo below which the fit ends."""

NUDGE = 0.02
"""Step of the finite differences."""


@dataclass(frozen=True, kw_only=True)
class Refitted:
    """A preset in `conserving`.

    fabric : with the albedos found
    error, delta_e : mean absolute difference over mean, and mean CIE 2000 difference of colours in
        which a white diffuser that faces the light is 1, over the pairs of `tables.directions`
    """

    fabric: Fabric
    error: float
    delta_e: float


def refitted_names() -> list[str]:
    """Names of the presets that have a second opinion: those without pile."""
    steepest = {n: max(t.curve.steepest for t in load(n).thread_list) for n in published_names()}
    return [name for name, angle in steepest.items() if angle <= PILE_ANGLE]


def conserving(fabric: Fabric, albedos: Floats) -> Fabric:
    """`fabric` with `conserving` threads of the albedos (threads, 3)."""
    threads = {
        name: replace(t, model="", albedo=(float(a[0]), float(a[1]), float(a[2])))
        for (name, t), a in zip(fabric.threads.items(), albedos, strict=True)
    }
    return replace(
        fabric, threads=threads, model=MODELS[-1], surface_law=SURFACE_LAWS[0], back=None
    )


def reflectance(fabric: Fabric) -> Floats:
    """(n, 3) radiance per unit `L_i dwi` for the pairs of `tables.directions`, at level `far`."""
    wi, wo, _ = directions()
    return surface.evaluate(fabric, wi, wo, shadow=surface.mean_shadow(fabric))


def refit(name: str) -> Refitted:
    """The brightness of each thread, its hue kept, with the least squared difference.

    Threads of the published models may be brighter than white: an albedo stops at 1.
    """
    fabric = load(name)
    asked = reflectance(fabric)
    hues = np.array([t.albedo for t in fabric.thread_list])
    hues /= np.maximum(hues.max(axis=1, keepdims=True), 1e-9)
    bright = np.full(len(hues), 0.5)
    for _ in range(STEPS):
        here = reflectance(conserving(fabric, hues * bright[:, None]))
        slopes = np.empty((len(bright), here.size))
        for k in range(len(bright)):
            moved = bright.copy()
            # Away from the nearer bound.
            step = -NUDGE if bright[k] > 0.5 else NUDGE
            moved[k] += step
            there = reflectance(conserving(fabric, hues * moved[:, None]))
            slopes[k] = (there - here).ravel() / step
        change = lsq_linear(
            slopes.T, (asked - here).ravel(), (-bright - 1e-12, 1.0 - bright + 1e-12)
        ).x
        bright = np.clip(bright + change, 0.0, 1.0)
        if np.abs(change).max() < CHANGE:
            break
    albedos = np.array([[float(f"{a:.4g}") for a in row] for row in hues * bright[:, None]])
    made = conserving(fabric, albedos)
    return Refitted(fabric=made, **distance(made, fabric))


def distance(one: Fabric, other: Fabric) -> dict[str, float]:
    """The figures of `Refitted`: how far `one` is from `other`."""
    here, there = reflectance(one), reflectance(other)
    return {
        "error": float(np.abs(here - there).mean() / there.mean()),
        "delta_e": float(delta_e_2000(math.pi * here, math.pi * there).mean()),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Print each preset's albedos and distance, and write them where asked to."""
    parser = argparse.ArgumentParser(
        prog="python -m fabricusd.geometry.conserve", description=__doc__
    )
    parser.add_argument("names", nargs="*", metavar="NAME", default=refitted_names())
    parser.add_argument("--write", action="store_true", help="change the presets' layers")
    options = parser.parse_args(arguments)
    for name in options.names:
        found = refit(name)
        told = ", ".join(
            f"{k} {' '.join(f'{a:.3f}' for a in t.albedo)}" for k, t in found.fabric.threads.items()
        )
        print(f"{name}: {told}; error {found.error:.2f}, dE {found.delta_e:.1f}", flush=True)
        if options.write:
            write_variant(name, CONSERVING, found.fabric)
    return 0


if __name__ == "__main__":
    sys.exit(main())

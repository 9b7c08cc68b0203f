"""Whether cloth keeps its brightness as the camera comes nearer: level `weave` against `far`.

    python bench/model/levels_agree.py [--presets NAME ...] [--law LAW] [--places N]
        [--spacing S]

For each preset, in the law that it wears, and each shadowing method: the mean of `weave` over even
places of the repeat, over `far`, less 1; for single lights from 5 degrees above the cloth, over
azimuths, and for views of 0, 35 and 65 degrees. `worst` is the largest of any channel, at the light
that is named (elevation, azimuth); `typical` is the median over lights and views. `noise` is the
worst of two halves of the places. Threads are even: uneven ones keep the mean over many threads
only (docs/yarn.md). `far` holds the mean of `horizon` under laws that do not mask. `--spacing .5`
puts the nodes of `far` half as far apart.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.laws import law_of
from fabricusd.appearance.published import tables
from fabricusd.appearance.surface import evaluate
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.quadrature import Rule, default_rule
from fabricusd.fabric import SURFACE_LAWS, Fabric, even
from fabricusd.schema import load, published_names

Floats = NDArray[np.float64]

ELEVATIONS = (5, 10, 20, 39, 60, 85)
AZIMUTHS = 8
VIEWS = ((0, 0), (35, 20), (65, 110))
STEP = np.array([0.7548776662466927, 0.5698402909980532])
"""The plane's most even additive sequence [Roberts2018]."""
DIM = 0.02
"""Channels and pairs that are dimmer than this share of the brightest are left out."""


def direction(polar: float, azimuth: float) -> Floats:
    """A unit vector, from angles in degrees."""
    t, p = np.radians(polar), np.radians(azimuth)
    return np.array([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)])


def off(fabric: Fabric, shadow: str, places: int) -> tuple[Floats, Floats]:
    """(elevations, azimuths, views) of the largest difference in a channel, and of its noise."""
    uv = (np.arange(places)[:, None] * STEP % 1.0) * true_repeat(fabric)
    shape = (len(ELEVATIONS), AZIMUTHS, len(VIEWS))
    near, halves, far = np.zeros((*shape, 3)), np.zeros((2, *shape, 3)), np.zeros((*shape, 3))
    for e, elevation in enumerate(ELEVATIONS):
        for a in range(AZIMUTHS):
            wi = direction(90 - elevation, 360 * (a + 0.25) / AZIMUTHS)
            for v, view in enumerate(VIEWS):
                wo = direction(*view)
                found = evaluate(
                    fabric, np.repeat(wi[None], places, axis=0), wo, uv, "weave", shadow
                )
                near[e, a, v] = found.mean(axis=0)
                halves[:, e, a, v] = found[::2].mean(axis=0), found[1::2].mean(axis=0)
                far[e, a, v] = evaluate(fabric, wi, wo, shadow=shadow)[0]
    seen = far > DIM * far.max()
    miss = np.where(seen, np.abs(near / np.where(seen, far, 1.0) - 1.0), 0.0)
    noise = np.where(seen, np.abs(halves[0] - halves[1]) / np.where(seen, far, 1.0), 0.0)
    return miss.max(axis=-1), noise.max(axis=-1) / 2.0


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presets", nargs="+", default=published_names())
    parser.add_argument("--law", choices=SURFACE_LAWS, help="in place of each preset's own")
    parser.add_argument("--shadows", nargs="+", default=["none", "peak", "horizon"])
    parser.add_argument("--places", type=int, default=40000)
    parser.add_argument("--spacing", type=float, default=1.0, help="of the nodes, times the usual")
    options = parser.parse_args()

    def spaced(fabric: Fabric, *, cells: bool = True) -> Rule:
        rule = default_rule(fabric, cells=cells)
        return rule._replace(spacing=rule.spacing * options.spacing)

    tables.default_rule = spaced
    print("| preset | law | shadow | worst | at | typical | noise |")
    print("|---|---|---|---|---|---|---|")
    for name in options.presets:
        fabric = even(load(name))
        if options.law:
            fabric = replace(fabric, surface_law=options.law)
        for shadow in options.shadows:
            if law_of(fabric).absolute and shadow not in ("none", "horizon"):
                continue
            miss, noise = off(fabric, shadow, options.places)
            e, a, _ = np.unravel_index(miss.argmax(), miss.shape)
            at = f"{ELEVATIONS[e]}°, {360 * (a + 0.25) / AZIMUTHS:.0f}°"
            print(
                f"| {name} | {fabric.surface_law} | {shadow} | {miss.max():.3f} | {at} | "
                f"{np.median(miss):.4f} | {noise.max():.4f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()

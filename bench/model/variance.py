"""The variance that importance sampling saves.

    python bench/model/variance.py [--write docs/sampling.md]

Printed is variance over mean^2 of the estimate for one view under an even sky, with directions
drawn uniformly and by `surface.sample`. Uniform directions cover the sphere if the cloth lets light
through, and else the hemisphere. The figures are averaged over views at 10 to 80 degrees, and at
levels `weave` and `thread` over places on threads.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from fabricusd.appearance import surface
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.fabric import MODELS, Fabric
from fabricusd.schema import load, published_names

DIRECTIONS = 4000
VIEWS = [(10, 20), (35, 0), (40, 90), (60, 215), (70, 130), (75, 0), (80, 75)]
"""Polar angle and azimuth in degrees."""
PLACES = 4


def unit(theta: float, phi: float) -> np.ndarray:
    t, p = math.radians(theta), math.radians(phi)
    return np.array([math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)])


def relative_variances(fabric: Fabric, level: str, wo: np.ndarray, uv: np.ndarray) -> list[float]:
    """[uniform, drawn], or [] if the view sees nothing."""
    rng = np.random.default_rng(5)
    n = DIRECTIONS
    drawn = surface.sample(fabric, wo, rng.random((n, 3)), uv=uv, level=level)
    ours = np.divide(drawn.f.mean(axis=1), drawn.pdf, out=np.zeros(n), where=drawn.pdf > 0)
    z, phi = rng.random(n), 2 * math.pi * rng.random(n)
    area = 2 * math.pi
    if fabric.model == "conserving" and not fabric.opaque:
        z, area = 2 * z - 1, 4 * math.pi
    flat = np.sqrt(1 - z * z)
    wi = np.stack((flat * np.cos(phi), flat * np.sin(phi), z), axis=1)
    even = surface.evaluate(fabric, wi, wo, uv=uv, level=level).mean(axis=1) * area
    mean = 0.5 * (ours.mean() + even.mean())
    return [even.var() / mean**2, ours.var() / mean**2] if mean > 0 else []


def row(fabric: Fabric, level: str) -> tuple[float, float]:
    """(uniform, drawn), averaged over views and places."""
    places = np.random.default_rng(2).random((40, 2)) * 20
    places = places[~lookup(fabric, places).gap][:PLACES]
    found = [
        relative_variances(fabric, level, unit(*view), uv)
        for view in VIEWS
        for uv in (places[:1] if level == "far" else places)
    ]
    return tuple(np.mean([f for f in found if f], axis=0))


def table() -> str:
    """The figures of every preset, model and level in Markdown."""
    lines = [
        "# What importance sampling saves",
        "",
        "`python bench/model/variance.py --write docs/sampling.md` makes this page.",
        "",
        "The table gives the variance over mean² of one view's estimate under an even sky, with",
        "directions drawn uniformly → with directions drawn by `surface.sample`. The next column",
        "is the ratio of the two. Figures are averages over seven views and, at `weave` and",
        "`thread`, over four places on threads, each place by itself.",
        "",
        "| preset | model | far | | weave | | thread | |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in published_names():
        for model in MODELS:
            preset = load(name)
            threads = {k: replace(t, model="") for k, t in preset.threads.items()}
            fabric = replace(preset, model=model, threads=threads)
            cells = []
            for level in surface.LEVELS:
                even, ours = row(fabric, level)
                cells += [f"{even:.2f} → {ours:.2f}", f"{ours / even:.2f}"]
            lines.append(f"| {name} | {model} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", type=Path, help="the Markdown file to write")
    path = parser.parse_args().write
    text = table()
    if path:
        path.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()

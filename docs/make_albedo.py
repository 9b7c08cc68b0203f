"""Write docs/albedo.md: the share of a white sky that each preset reflects, and its safe albedo.

python docs/make_albedo.py
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from fabricusd.appearance import surface
from fabricusd.appearance.albedo import FINE, albedo_by_view, safe_albedo
from fabricusd.appearance.laws import law_of
from fabricusd.appearance.published.excess import white_sky
from fabricusd.fabric import Fabric
from fabricusd.geometry.nearest import published
from fabricusd.schema import load, published_names

HERE = Path(__file__).resolve().parent
THETA = (0.0, 30.0, 60.0, 75.0, 85.0, 89.0, 89.9)
AZIMUTHS = 8
SAMPLES = 4096

TABLES = {
    "The presets": "",
    "microcylinder": "microcylinder",
    "thesis": "thesis",
    "conserving": "conserving",
}
"""Title of each table -> the model of every thread in it; "" keeps the preset's own."""
PRINTED = ("microcylinder", "thesis")
"""Tables of the published numbers."""

HEAD = """# Directional albedo and safe albedos

`python docs/make_albedo.py` makes this page; `make docs` runs it.

The tables give the share of a white sky's light that reaches the viewer, by the angle between view
and normal. They show the brightest channel, at the worst of 16 azimuths (8 for `conserving`).
The first table is of the presets as they are, each with its own surface law and its mean shadow.
Laws with an absolute shadow divide by what would be too much, so that any `A` is safe. The next
two are of the published numbers under the published law, `masked`, which do not conserve energy.
*Safe A* is the largest albedo of white threads at which the cloth reflects no more light than
arrives, in any view. `fabricusd check` warns where a fabric's own colours reflect more than that
(`AlbedoIsSafe`).

For `conserving`, the value is reflection plus transmission, including multiple scattering, from
{samples} samples per view. An `A` of this model is an albedo, and any value from 0 to 1 is safe.
"""


def uniform_model(fabric: Fabric, model: str) -> Fabric:
    """`fabric` with the same model for every thread."""
    threads = {name: replace(t, model="") for name, t in fabric.threads.items()}
    return replace(fabric, model=model, threads=threads, back=None)


def shadowed(fabric: Fabric) -> list[float]:
    """Reflected share at each angle with the mean shadow, by the quadrature of `white_sky`."""
    sky, weight = white_sky()
    shadow = surface.mean_shadow(fabric)
    worst = []
    for theta in np.radians(THETA):
        shares = []
        for phi in np.arange(2 * AZIMUTHS) * math.pi / AZIMUTHS:
            wo = np.array(
                [math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)]
            )
            wo = np.broadcast_to(wo, sky.shape)
            values = surface.evaluate(fabric, sky, wo, level="far", shadow=shadow)
            shares.append(float((weight @ values).max()))
        worst.append(max(shares))
    return worst


def conserving(fabric: Fabric) -> list[float]:
    """Reflected plus transmitted share at each angle, by importance sampling."""
    rng = np.random.default_rng(11)
    worst = []
    for theta in np.radians(THETA):
        shares = []
        for phi in np.arange(AZIMUTHS) * 2 * math.pi / AZIMUTHS:
            wo = np.array(
                [math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)]
            )
            drawn = surface.sample(fabric, wo, rng.random((SAMPLES, 3)))
            weight = np.where(drawn.pdf > 0, 1 / np.where(drawn.pdf > 0, drawn.pdf, 1), 0)
            shares.append((drawn.f * weight[:, None]).mean(axis=0).max())
        worst.append(max(shares))
    return worst


def row(name: str, values: list[float], safe: str) -> str:
    """One row of a table."""
    return f"| {name} | " + " | ".join(f"{v:.3f}" for v in values) + f" | {safe} |"


def main() -> None:
    """Write the page."""
    lines = [HEAD.format(samples=SAMPLES)]
    columns = " | ".join(f"{t:g}°" for t in THETA)
    for title, model in TABLES.items():
        lines += [f"## {title}", "", f"| preset | {columns} | safe A |"]
        lines += ["|---" * (len(THETA) + 2) + "|"]
        for name in published_names():
            fabric = published(name) if title in PRINTED else load(name)
            if model:
                fabric = uniform_model(fabric, model)
            if model == "conserving":
                lines.append(row(name, conserving(fabric), "1"))
                continue
            if title not in PRINTED and law_of(fabric).absolute:
                lines.append(row(name, shadowed(fabric), "any"))
                continue
            values = albedo_by_view(fabric, np.radians(THETA), FINE).max(axis=(1, 2))
            lines.append(row(name, values.tolist(), f"{safe_albedo(fabric, FINE):.2f}"))
        lines.append("")
    (HERE / "albedo.md").write_text("\n".join(lines))


if __name__ == "__main__":
    main()

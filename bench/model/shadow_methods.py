"""Compare the shadowing methods with the marched height field, for docs/shadowing_measured.md.

    python bench/model/shadow_methods.py [--figure docs/images/shadowing.png]

Every number is taken over places spread evenly on the threads of one repeat and over 16 azimuths of
the light.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numba
import numpy as np

from fabricusd.appearance.shadow.kinds import METHODS
from fabricusd.appearance.shadow.methods import compile_shadow, shadowing
from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.chart.panels.shadows import (
    AZIMUTHS,
    ELEVATIONS,
    TABLES,
    WOVEN,
    light,
    places_on_threads,
    rms,
    shares,
)
from fabricusd.fabric import Fabric, even
from fabricusd.schema import load

Array = np.ndarray


def all_shares(fabric: Fabric, uv: Array) -> dict[str, Array]:
    """Method -> (elevations, azimuths, places) `g`."""
    cloth = compile_fabric(fabric, precision=np.float64)
    return {
        method: shares(
            fabric, uv, cloth,
            compile_shadow(fabric, method, precision=np.float64),
        )
        for method in METHODS
    }  # fmt: skip


def by_elevation(name: str, uv: Array, found: dict[str, Array]) -> None:
    """Print the mean share of light and its rms difference from `traced`, by elevation."""
    print(f"\n**{name}** (mean `g`; in brackets rms difference from `traced`)\n")
    print("| elevation | traced | none | peak | horizon |")
    print("|---|---|---|---|---|")
    for k, elevation in enumerate(ELEVATIONS):
        true = found["traced"][k]
        cells = [
            f"{found[m][k].mean():.2f} ({rms(found[m][k] - true):.2f})"
            for m in ("none", "peak", "horizon")
        ]
        print(f"| {elevation}° | {true.mean():.2f} | {' | '.join(cells)} |")
    means = {m: found[m].mean(axis=2) for m in METHODS}
    worst = {
        m: float(np.abs(means[m] - means["traced"]).max()) for m in ("none", "peak", "horizon")
    }
    print(
        "\nLargest error of the mean over the cloth, at any elevation and azimuth: "
        + ", ".join(f"{m} {x:.2f}" for m, x in worst.items())
        + "."
    )


def by_azimuth(fabric: Fabric, uv: Array, found: dict[str, Array]) -> None:
    """Print the mean `g` at 20 degrees by azimuth: traced/horizon/peak."""
    k = ELEVATIONS.index(20)
    print(f"\n**{fabric.name}: light at 20°, by azimuth** (traced / horizon / peak)\n")
    chosen = range(0, AZIMUTHS // 2, 2)
    print("| " + " | ".join(f"{360 * (a + 0.25) / AZIMUTHS:.0f}°" for a in chosen) + " |")
    print("|" + "---|" * len(chosen))
    cells = [
        " / ".join(f"{found[m][k, a].mean():.2f}" for m in ("traced", "horizon", "peak"))
        for a in chosen
    ]
    print("| " + " | ".join(cells) + " |")


def by_table(count: int) -> None:
    """Print the error of finer tables, over all woven presets."""
    print("\n**Size of the table** (rms difference from `traced`, 2° to 70°)\n")
    print("| azimuths, texels | bytes a cell | " + " | ".join(WOVEN) + " |")
    print("|---|---|" + "---|" * len(WOVEN))
    rng = np.random.default_rng(0)
    for azimuths, texels in TABLES:
        row = []
        for name in WOVEN:
            fabric = even(load(name))
            uv = places_on_threads(fabric, count)
            e, a = rng.uniform(2, 70, len(uv)), rng.uniform(0, 360, len(uv))
            wi = np.array([light(*pair) for pair in zip(e, a, strict=True)])
            cloth = compile_fabric(fabric, precision=np.float64)
            table = compile_shadow(fabric, azimuths=azimuths, texels=texels, precision=np.float64)
            true = shadowing(fabric, wi, uv, "traced")
            row.append(f"{rms(shadowing(fabric, wi, uv, compiled=(cloth, table)) - true):.3f}")
        size = azimuths * texels
        print(f"| {azimuths}, {texels} | {size} | " + " | ".join(row) + " |")


def speed(count: int) -> None:
    """Print the time of a shadow by each method, with one worker, and that to fill the table."""
    numba.set_num_threads(1)
    print("\n**Time**, float32, one worker (ns a shadow, lookup included; ms for the table)\n")
    print("| preset | none | peak | horizon | traced | table |")
    print("|---|---|---|---|---|---|")
    for name in WOVEN:
        fabric = even(load(name))
        uv = places_on_threads(fabric, count)
        wi = np.tile(light(20, 30), (len(uv), 1)).astype(np.float32)
        cloth, row = compile_fabric(fabric), []
        for method in METHODS:
            shadow = compile_shadow(fabric, method)
            seconds = []
            for _ in range(9):
                start = time.perf_counter()
                shadowing(fabric, wi, uv, compiled=(cloth, shadow))
                seconds.append(time.perf_counter() - start)
            row.append(f"{min(seconds) / len(uv) * 1e9:.0f}")
        start = time.perf_counter()
        compile_shadow(fabric)
        row.append(f"{(time.perf_counter() - start) * 1e3:.0f}")
        print(f"| {name} | " + " | ".join(row) + " |")


def figure(path: Path) -> None:
    """Draw maps of `g` over a repeat of crepe and of satin, lit from the left at 15 degrees."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    chosen = ("silk_crepe_de_chine", "polyester_satin_charmeuse")
    size = 320
    image, axes = plt.subplots(len(chosen), 4, figsize=(10, 5.4), layout="constrained")
    for row, name in zip(axes, chosen, strict=True):
        fabric = even(load(name))
        ends, picks = fabric.weave.cells.shape
        u, v = np.meshgrid(
            (np.arange(size) + 0.5) / size * ends, (np.arange(size) + 0.5) / size * picks
        )
        uv = np.stack([u.ravel(), v.ravel()], axis=1)
        hit = lookup(fabric, uv)
        wi = np.tile(light(15, 180), (len(uv), 1))
        pictures = {"thread on top": np.where(hit.set == 1, 0.75, 0.35)}
        for method in ("peak", "horizon", "traced"):
            pictures[method] = shadowing(fabric, wi, uv, method)
        for cell, (label, picture) in zip(row, pictures.items(), strict=True):
            shown = np.where(hit.gap, 0.0, picture).reshape(size, size)
            cell.imshow(
                shown, cmap="gray", vmin=0, vmax=1, origin="lower", extent=(0, ends, 0, picks)
            )
            cell.set_title(label)
        row[0].set_ylabel(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    image.savefig(path, dpi=100)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--places", type=int, default=4000)
    parser.add_argument("--figure", type=Path, help="draw the maps of g to this file")
    options = parser.parse_args()
    for name in WOVEN:
        fabric = even(load(name))
        uv = places_on_threads(fabric, options.places)
        found = all_shares(fabric, uv)
        by_elevation(name, uv, found)
        by_azimuth(fabric, uv, found)
    by_table(options.places)
    speed(50 * options.places)
    if options.figure:
        figure(options.figure)


if __name__ == "__main__":
    main()

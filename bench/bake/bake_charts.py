"""Measure the figures of docs/baking_error.md and docs/btf.md: time, BTF error, horizons, tracing.

    python bench/bake/bake_charts.py [--texels 512 1024 2048 4096] [--btf] [--horizon] [--to DIR]

Each figure is printed as a table and drawn into DIR (default: docs/images).
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from bench_bake import square

from fabricusd.appearance.shadow.methods import shadowing
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.bake.btf.factored import factored, write_atlas, write_factored
from fabricusd.bake.btf.factors import decomposed, factors
from fabricusd.bake.btf.matrix import btf_of
from fabricusd.bake.btf.ubo import write_ubo
from fabricusd.bake.btf.write import between
from fabricusd.bake.layout.garment import garments
from fabricusd.bake.texels.blocks import bake_block
from fabricusd.bake.texels.maps import REGISTRY
from fabricusd.bake.texels.moment_indices import AZIMUTHS
from fabricusd.bake.texels.recipe import recipe
from fabricusd.bake.texels.sheet import sheets_of, texel_start, texel_step
from fabricusd.fabric import Fabric
from fabricusd.schema import load

CLOTHS = ("linen_plain", "polyester_satin_charmeuse")
RANKS = (1, 2, 4, 8, 16, 32)

Array = np.ndarray

ONE_BAKE = """
import resource, sys, tempfile, time
sys.path.insert(0, "bench")
from bench_bake import write_square
from fabricusd.bake.bake import Settings, bake
from fabricusd.fabric import Binding
from fabricusd.schema import load
linen = Binding(fabric=load("linen_plain"), threads_per_uv=(300.0, 300.0))
with tempfile.TemporaryDirectory() as folder:
    scene = write_square(folder)
    bake(scene, folder + "/warm", Settings(resolution=64), fabric=linen)
    began = time.process_time()
    bake(scene, folder + "/out", Settings(resolution=int(sys.argv[1])), fabric=linen, workers=2)
    seconds = time.process_time() - began
print(seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6)
"""


def by_texels(resolutions: list[int], path: Path) -> None:
    """Processor time and peak memory of whole bakes, each in a process of its own."""
    rows = []
    for resolution in resolutions:
        shown = subprocess.run(
            [sys.executable, "-c", ONE_BAKE, str(resolution)],
            check=True, capture_output=True, text=True, env=dict(os.environ),
        )  # fmt: skip
        seconds, peak = map(float, shown.stdout.split())
        rows.append((resolution, seconds, peak))
        print(
            f"{resolution:5} x {resolution:<5} {seconds:7.1f} processor seconds, "
            f"{seconds / resolution**2 * 1e6:5.2f} microseconds a texel, peak {peak:.2f} GB",
            flush=True,
        )
    texels, seconds, peaks = np.array(rows).T
    plt, (left, right) = axes(2)
    left.loglog(texels**2, seconds, "o-", label="measured")
    left.loglog(texels**2, seconds[-1] * (texels / texels[-1]) ** 2, ":", label="linear")
    left.set(xlabel="texels", ylabel="processor seconds")
    left.legend()
    right.semilogx(texels**2, peaks, "o-")
    right.set(xlabel="texels", ylabel="peak memory [GB]", ylim=(0, None))
    save(plt, path)


def btf_curve(path: Path) -> None:
    """Error of the BTF forms against their size, by rank."""
    plt, sides = axes(len(CLOTHS))
    for side, name in zip(sides, CLOTHS, strict=True):
        fabric = load(name)
        btf = btf_of(fabric)
        curves: dict[str, list[tuple[float, float]]] = {}
        for joint in (False, True):
            full = decomposed(btf, joint)
            for rank in RANKS:
                made = factors(btf, joint=joint, rank=rank, full=full)
                one = factored(btf, made)
                for form, megabytes in sizes(btf, made, one, joint):
                    curves.setdefault(form, []).append((megabytes, made.delta_e))
                    print(
                        f"{name:26} {form:10} rank {rank:3} {megabytes:6.2f} MB  "
                        f"delta E {made.delta_e:5.2f}",
                        flush=True,
                    )
        apart = float(between(fabric, [one]).mean())
        print(f"{name:26} between directions {apart:.2f}")
        for form, points in curves.items():
            side.loglog(*np.array(points).T, "o-", label=form)
        side.axhline(apart, ls=":", color="grey")
        side.text(
            0.02,
            apart * 1.05,
            "between the table's directions",
            fontsize=8,
            transform=side.get_yaxis_transform(),
        )
        side.set(title=name, xlabel="MB", ylabel="mean delta E 2000 on the table's directions")
        side.legend()
    save(plt, path)


def sizes(btf: Any, made: Any, one: Any, joint: bool) -> list[tuple[str, float]]:
    """Form -> megabytes of its files."""
    with tempfile.TemporaryDirectory() as folder:
        stem = Path(folder) / "a"
        write_ubo(stem.with_suffix(".btf"), btf, made)
        found = [("ubo-joint" if joint else "ubo", [stem.with_suffix(".btf")])]
        if joint:
            write_factored(stem.with_suffix(".npz"), one)
            found += [
                ("factored", [stem.with_suffix(".npz")]),
                ("atlas", list(write_atlas(stem, one))),
            ]
        return [(form, sum(f.stat().st_size for f in files) / 1e6) for form, files in found]


def horizons(path: Path) -> None:
    """Share of places whose light is wrong by a baked horizon map, compared with marching."""
    counts, densities = (4, 8, 16), (2, 4, 8, 16)
    plt, sides = axes(len(CLOTHS))
    for side, name in zip(sides, CLOTHS, strict=True):
        found = np.array([horizon_errors(load(name), d, counts) for d in densities])
        for k, count in enumerate(counts):
            side.plot(densities, found[:, k, 0] * 100, "o-", label=f"{count} azimuths")
            for d, (wrong, bias) in zip(densities, found[:, k], strict=True):
                print(
                    f"{name:26} {count:2} azimuths, {d:2} texels a thread: "
                    f"{wrong:6.2%} of places wrong, mean {bias:+.2%}"
                )
        side.set(title=name, xlabel="texels per thread", ylabel="% of places wrong", ylim=(0, None))
        side.set_xscale("log", base=2)
        side.legend()
    save(plt, path)


def horizon_errors(fabric: Fabric, density: int, counts: tuple[int, ...]) -> Array:
    """(counts, 2) share of wrong places and mean excess of light, over 24 lights."""
    size = 256
    one = garments(square(fabric, size / density))[0]
    sheet = sheets_of(one, (recipe(fabric),), {1001: (0, 0)}, size, 0)[0]
    maps = [REGISTRY[f"horizon_{k:02d}"] for k in range(0, AZIMUTHS, 4)]
    blocks, _, _ = bake_block(sheet, maps, 0, 0)
    sine = np.concatenate([levels[0] for levels in blocks], axis=2).astype(np.float64)
    places = np.random.default_rng(0).random((4096, 2)) * size
    uv = texel_start(sheet, 0, 0, 0) + places @ texel_step(sheet, 0).T
    seen = ~lookup(fabric, uv).gap
    here = sine[places[seen, 1].astype(int), places[seen, 0].astype(int)]
    errors = np.zeros((len(counts), 2))
    lights = [(e, a) for e in (5, 10, 20, 30) for a in np.arange(6) * 60 + 7.0]
    for elevation, azimuth in lights:
        e, a = math.radians(elevation), math.radians(azimuth)
        wi = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
        true = shadowing(fabric, np.repeat(wi[None], seen.sum(), axis=0), uv[seen], "traced")
        for k, count in enumerate(counts):
            got = wi[2] > between_azimuths(here[:, :: AZIMUTHS // count], wi)
            errors[k] += np.abs(got - true).mean(), (got - true).mean()
    return errors / len(lights)


def between_azimuths(sine: Array, wi: Array) -> Array:
    """(n,) sine of the horizon towards wi, linear between the azimuths of (n, count) sines."""
    count, reach = sine.shape[1], abs(wi[0]) + abs(wi[1])
    quarter = wi[1] / reach
    turn = quarter if wi[0] >= 0 else 2.0 - quarter
    place = (turn % 4.0) / 4.0 * count
    low = int(place) % count
    share = place - int(place)
    return sine[:, low] * (1.0 - share) + sine[:, (low + 1) % count] * share


def axes(count: int) -> tuple[Any, Any]:
    """(matplotlib's pyplot, `count` axes side by side)."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    _, sides = plt.subplots(1, count, figsize=(10, 4))
    return plt, sides


def save(plt: Any, path: Path) -> None:
    """Write the current figure."""
    path.parent.mkdir(parents=True, exist_ok=True)
    plt.tight_layout()
    plt.savefig(path, dpi=100)
    print(path)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--texels", nargs="+", type=int, metavar="N")
    parser.add_argument("--btf", action="store_true")
    parser.add_argument("--horizon", action="store_true")
    parser.add_argument("--to", type=Path, default=Path("docs/images"), metavar="DIR")
    options = parser.parse_args()
    if options.texels:
        by_texels(options.texels, options.to / "bake_texels.png")
    if options.btf:
        btf_curve(options.to / "bake_btf.png")
    if options.horizon:
        horizons(options.to / "bake_horizon.png")

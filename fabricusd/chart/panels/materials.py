"""Panel: standard surfaces over baked textures, compared with the cloth that they represent."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fabricusd.appearance import surface
from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings
from fabricusd.chart.panel import Panel, Row
from fabricusd.chart.timing import in_turns, typical
from fabricusd.fabric import Binding, Fabric
from fabricusd.materials.bake_folder import read_bake_folder
from fabricusd.materials.fit.fit import fit
from fabricusd.materials.fit.forward import forward
from fabricusd.materials.fit.judge import direction_pairs
from fabricusd.materials.fit.models import KINDS
from fabricusd.materials.fit.target import TexelSample
from fabricusd.materials.fit.texels import NEEDED, draw_texels
from fabricusd.materials.networks.look import Look
from fabricusd.schema import load

PRESETS = (
    "linen_plain", "silk_crepe_de_chine", "polyester_satin_charmeuse", "silk_shot", "velvet",
    "wool_flannel",
)  # fmt: skip
QUICK_PRESETS = ("linen_plain",)
QUICK_KINDS = ("preview", "openpbr")
THREADS = 6400.0
"""Threads along the square that is baked; with so many, a texel spans whole repeats."""

SQUARE = (
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
)


def baked_texels(fabric: Fabric, folder: Path, threads: float = THREADS) -> TexelSample:
    """Texels of a square of `fabric` with `threads` along its side, baked at 64 x 64."""
    scene = folder / "square.obj"
    scene.write_text(SQUARE)
    out = folder / f"{fabric.name}_{threads:g}"
    binding = Binding(fabric=fabric, threads_per_uv=(threads, threads))
    bake(scene, out, Settings(resolution=64, maps=(*NEEDED, "thread_id")), fabric=binding)
    maps = read_bake_folder(out).garments[0]
    found = draw_texels(maps, 0, maps.lays[0])
    assert found is not None, "the maps that were asked for are all baked"
    return found


def run(quick: bool) -> list[Row]:
    """A group of rows for each preset: every kind of surface, fitted and unfitted, and the law."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for preset in QUICK_PRESETS if quick else PRESETS:
            fabric = load(preset)
            rows += _rows(fabric, baked_texels(fabric, Path(name)), quick)
    return rows


def _rows(fabric: Fabric, texels: TexelSample, quick: bool) -> list[Row]:
    wi, wo = direction_pairs()
    # A renderer shades one texel at a time, so time one; seen from afar, all of them count.
    one = texels.part(slice(1))
    law = "the law, far"
    runs: dict[str, Callable[[], object]] = {
        law: lambda: surface.evaluate(
            fabric, wi, wo, level="far", shadow=surface.mean_shadow(fabric)
        )
    }
    errors, highest = {law: 0.0}, {law: 0.0}
    for kind in QUICK_KINDS if quick else KINDS:
        found = fit(kind, texels, fabric)
        runs[f"{kind}, fitted"] = partial(forward, kind, found.look, one, wi[None], wo[None])
        errors[f"{kind}, fitted"] = found.delta_e
        highest[f"{kind}, fitted"] = found.delta_e_95
        runs[f"{kind}, textures alone"] = partial(forward, kind, Look(), one, wi[None], wo[None])
        errors[f"{kind}, textures alone"] = found.start_delta_e
    rows = []
    for method, seconds in in_turns(runs, 2 if quick else 5).items():
        cost, spread = typical(np.array(seconds) / len(wi) * 1e9)
        figures = {"delta_e_95": highest[method]} if method in highest else {}
        rows.append(
            Row(
                group=fabric.name, method=method, cost=cost, cost_spread=spread,
                error=errors[method], figures=figures,
            )
        )  # fmt: skip
    return rows


def draw(figure: Any, rows: Sequence[Row]) -> None:
    """Draw bars of delta E by preset and surface: fitted in colour, textures alone in grey."""
    axes = figure.subplots()
    presets = list(dict.fromkeys(row.group for row in rows))
    kinds = [k for k in KINDS if any(row.method.startswith(f"{k},") for row in rows)]
    error = {(row.group, row.method): row.error for row in rows}
    width, x = 0.8 / len(kinds), np.arange(len(presets))
    for n, kind in enumerate(kinds):
        at = x + (n - 0.5 * (len(kinds) - 1)) * width
        alone = [error[p, f"{kind}, textures alone"] for p in presets]
        axes.bar(at, alone, width, color="0.85", label="textures alone" if n == 0 else None)
        axes.bar(at, [error[p, f"{kind}, fitted"] for p in presets], 0.8 * width, label=kind)
    axes.set_xticks(x, presets, fontsize=8)
    axes.set_ylabel(PANEL.error)
    axes.grid(axis="y", alpha=0.3)
    axes.legend(fontsize=8, ncols=3)


PANEL = Panel(
    name="materials",
    title="Downstream materials",
    cost="ns an evaluation",
    error="mean delta E 2000",
    about=(
        "Standard surfaces over a bake whose texels span whole repeats are compared with level "
        "`far` over pairs of directions of the hemisphere. `preview` is UsdPreviewSurface. "
        "`principled` is Blender's Principled BSDF. The cost of a surface is the cost of its "
        "formulas in NumPy, and the cost of the law is the cost of its float64 kernels. A "
        "renderer's own costs differ. [blender.md](blender.md) compares pictures of the "
        "surfaces in Cycles."
    ),
    run=run,
    draw=draw,
)

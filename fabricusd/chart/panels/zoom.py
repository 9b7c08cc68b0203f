"""Panel: moiré and blur of cloth at a distance, by method of sampling and filtering."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.accuracy import spread_pairs
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.surface import far_all, weave_all
from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.appearance.weave.footprint import weights
from fabricusd.chart.cloth_picture import View, difference, ideal_spectrum, picture, view_of
from fabricusd.chart.panel import Panel, Row
from fabricusd.chart.panels.reflectance import places
from fabricusd.chart.timing import in_turns, typical
from fabricusd.fabric import Fabric, even
from fabricusd.schema import load

Floats = NDArray[np.float64]

PRESETS = ("linen_plain", "polyester_satin_charmeuse")
WIDTHS = (0.1, 0.2, 0.35, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.7, 8.0, 11.0, 16.0, 30.0)
QUICK_WIDTHS = (0.2, 1.0, 4.0, 30.0)
ACROSS = (1, 2, 4, 8)
"""Samples along the side of a pixel."""

PARTS = ("alias", "blur", "shift")

LIGHTS = ((0.48, 0.36, 0.8), (-0.6, 0.0, 0.8), (0.0, 0.8, 0.6))
"""Directions to the light; figures and spreads are taken over them."""


def run(quick: bool) -> list[Row]:
    """A group of rows for each preset and each width of a pixel in threads."""
    rows = []
    for name in PRESETS:
        fabric = even(load(name))
        cost = sample_costs(fabric, 4096 if quick else 65536, 3 if quick else 7)
        for width in QUICK_WIDTHS if quick else WIDTHS:
            views = [view_of(fabric, width, light) for light in LIGHTS[: 1 if quick else None]]
            rows += _rows(name, views, cost)
    return rows


def sample_costs(fabric: Fabric, count: int, rounds: int) -> dict[str, tuple[float, float]]:
    """Level, `far` or `weave` -> (median, spread) of the cost of a sample [ns].

    In float32, with one worker; `weave` includes finding the place and its shadow by table.
    """
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        real: Any = np.float32
        wi, wo = (w.astype(real) for w in spread_pairs(count))
        out, uv = np.empty_like(wi), places(fabric, count)
        tables = surface_tables(fabric, precision=real)
        cloth = compile_fabric(fabric, precision=real)
        shadow = compile_shadow(fabric, "horizon", precision=real)
        taken = in_turns(
            {
                "far": lambda: far_all(real, tables, wi, wo, out),
                "weave": lambda: weave_all(real, cloth, shadow, tables, uv, wi, wo, out),
            },
            rounds,
        )
    finally:
        numba.set_num_threads(before)
    return {level: typical(np.array(x) / count * 1e9) for level, x in taken.items()}


def _rows(name: str, views: Sequence[View], cost: dict[str, tuple[float, float]]) -> list[Row]:
    pictures = [_pictures(view) for view in views]
    ideals = [ideal_spectrum(view) for view in views]
    far_share = _far_share(views[0])
    rows = []
    for method in pictures[0]:
        splits = [difference(p[method], i) for p, i in zip(pictures, ideals, strict=True)]
        total, spread = typical([s.total for s in splits])
        across = int(method.split("×")[-1]) if "×" in method else 1
        share = {"far": 1.0, "auto": far_share}.get(method.split(",")[0], 0.0)
        ns, ns_spread = (
            across**2 * (share * cost["far"][k] + (1.0 - share) * cost["weave"][k]) for k in (0, 1)
        )
        rows.append(
            Row(
                group=f"{name}, {views[0].threads_per_pixel:.2g} threads a pixel",
                method=method,
                cost=ns,
                cost_spread=ns_spread,
                error=total,
                error_spread=spread,
                figures={
                    "threads_per_pixel": views[0].threads_per_pixel,
                    **{k: float(np.median([getattr(s, k) for s in splits])) for k in PARTS},
                },
            )
        )
    return rows


def _far_share(view: View) -> float:
    """Probability with which level `auto` takes `far`."""
    width = view.threads_per_pixel
    return float(weights(view.fabric, [[width, width]])[0, 0])


def _pictures(view: View) -> dict[str, Floats]:
    """Method -> picture. `auto` mixes its levels by their weights, as it does over many samples."""
    found = {"far": picture(view, "far", 1)}
    share = _far_share(view)
    for across in ACROSS:
        woven = picture(view, "weave", across)
        name = "weave, point" if across == 1 else f"weave, {across}×{across}"
        found[name] = woven
        mixed = share * found["far"] + (1.0 - share) * woven
        found["auto, point" if across == 1 else f"auto, {across}×{across}"] = mixed
    return found


def draw(figure: Any, rows: Sequence[Row]) -> None:
    """Plot alias and blur against the width of a pixel, with a curve for each method."""
    names = list(dict.fromkeys(row.group.split(",")[0] for row in rows))
    methods = ("far", "weave, point", "weave, 4×4", "weave, 8×8", "auto, point", "auto, 4×4")
    grid = figure.subplots(2, len(names), sharex=True, sharey=True, squeeze=False)
    for column, name in enumerate(names):
        for axes, figure_name in zip(grid[:, column], ("alias", "blur"), strict=True):
            for method in methods:
                mine = [r for r in rows if r.method == method and r.group.startswith(f"{name},")]
                x = [r.figures["threads_per_pixel"] for r in mine]
                style = {"f": ":", "w": "-", "a": "--"}[method[0]]
                axes.plot(
                    x, [r.figures[figure_name] for r in mine], style, marker=".", label=method
                )
            axes.set_xscale("log")
            axes.set_yscale("symlog", linthresh=0.01)
            axes.set_ylim(0, 9)
            axes.set_ylabel(f"{figure_name} over mean")
            axes.grid(alpha=0.3)
        grid[0, column].set_title(name, fontsize=9)
        grid[1, column].set_xlabel("threads a pixel")
    grid[0, 0].legend(fontsize=7)


PANEL = Panel(
    name="zoom",
    title="Moiré and blur",
    cost="ns a pixel, one worker",
    error="rms difference over mean",
    about=(
        "The scene is a flat cloth seen by a rolled camera; the group says how many threads a "
        "pixel spans. "
        "The level is `weave` with shadows by `horizon`, unless the method names another; `auto` "
        "here uses only `far` and `weave`. The reference is the cloth's spectrum below the "
        "picture's Nyquist frequency. Alias is what the picture contains beyond the reference, "
        "mostly moiré. Blur is what it lacks. Shift is the error of its mean. The square of the "
        "error is the sum of their squares."
    ),
    run=run,
    draw=draw,
)

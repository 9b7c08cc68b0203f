"""Panel: methods for shadows between threads, against the marched height field."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numba
import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.shadow.kinds import METHODS, Shadow
from fabricusd.appearance.shadow.methods import compile_shadow, shadowing
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.chart.panel import Panel, Row
from fabricusd.chart.panels.reflectance import places
from fabricusd.chart.timing import in_turns, typical
from fabricusd.fabric import Fabric, even
from fabricusd.schema import load

Floats = NDArray[np.float64]

WOVEN = (
    "linen_plain",
    "silk_crepe_de_chine",
    "polyester_satin_charmeuse",
    "polyester_satin_charmeuse_back",
    "silk_shot",
)
ELEVATIONS = (5, 10, 20, 30, 45, 60)
"""Elevations of the light [degrees]."""

AZIMUTHS = 16
TABLES = ((16, 4), (16, 8), (32, 8), (16, 16), (64, 32))
"""Sizes of the `horizon` table, including the usual one: azimuths, texels along a thread."""

USUAL = "horizon, 16 of 8"


def places_on_threads(fabric: Fabric, count: int) -> Floats:
    """(n, 2) weave coordinates, spread evenly over the threads of one repeat but not over gaps."""
    uv = places(fabric, count)
    return uv[~lookup(fabric, uv).gap]


def light(elevation: float, azimuth: float) -> Floats:
    """(3,) unit direction; angles are in degrees, the azimuth goes from U to V."""
    e, a = math.radians(elevation), math.radians(azimuth)
    return np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])


def shares(fabric: Fabric, uv: Floats, cloth: CompiledFabric, shadow: Shadow) -> Floats:
    """(elevations, azimuths, places) share of the light that arrives at each place."""
    return np.array(
        [
            [
                shadowing(
                    fabric,
                    np.tile(light(e, 360 * (a + 0.25) / AZIMUTHS), (len(uv), 1)),
                    uv,
                    compiled=(cloth, shadow),
                )
                for a in range(AZIMUTHS)
            ]
            for e in ELEVATIONS
        ]
    )


def rms(x: Floats) -> float:
    """Root mean square."""
    return math.sqrt(float((x * x).mean()))


def run(quick: bool, names: Sequence[str] = ()) -> list[Row]:
    """A group of rows for each woven preset, or for each of `names`."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        names = names or ((WOVEN[0], WOVEN[2]) if quick else WOVEN)
        return [row for name in names for row in _rows(even(load(name)), quick)]
    finally:
        numba.set_num_threads(before)


def _rows(fabric: Fabric, quick: bool) -> list[Row]:
    double = compile_fabric(fabric, precision=np.float64)
    uv = places_on_threads(fabric, 300 if quick else 1500)
    exact = shares(fabric, uv, double, compile_shadow(fabric, "traced", precision=np.float64))
    cloth, shadows = compile_fabric(fabric), _shadows(fabric, quick)
    many = np.resize(uv, (2000 if quick else 50_000, 2))
    wi = np.tile(light(20, 30), (len(many), 1)).astype(np.float32)
    taken = in_turns(
        {
            name: partial(shadowing, fabric, wi, many, compiled=(cloth, shadow))
            for name, shadow in shadows.items()
        },
        3 if quick else 7,
    )
    rows = []
    for name, shadow in shadows.items():
        miss = shares(fabric, uv, cloth, shadow) - exact
        cost, cost_spread = typical(np.array(taken[name]) / len(many) * 1e9)
        by_azimuth = [rms(miss[:, a]) for a in range(AZIMUTHS)]
        rows.append(
            Row(
                group=fabric.name, method=name, cost=cost, cost_spread=cost_spread,
                error=rms(miss), error_spread=typical(by_azimuth)[1] / math.sqrt(AZIMUTHS),
                figures={
                    "worst_mean_error": float(np.abs(miss.mean(axis=2)).max()),
                    "table_bytes": float(shadow.table.nbytes if "horizon" in name else 0),
                },
            )
        )  # fmt: skip
    return rows


def _shadows(fabric: Fabric, quick: bool) -> dict[str, Shadow]:
    """Every method, and `horizon` with tables of other sizes, all in single precision."""
    found = {method: compile_shadow(fabric, method) for method in METHODS}
    for azimuths, texels in () if quick else TABLES:
        name = f"horizon, {azimuths} of {texels}"
        if name != USUAL:
            found[name] = compile_shadow(fabric, azimuths=azimuths, texels=texels)
    return found


PANEL = Panel(
    name="shadows",
    title="Shadows from thread to thread",
    cost="ns a shadow, one worker, light at 20°",
    error="rms difference of g from traced",
    about=(
        "Each method computes the share `g` of the light that reaches places spread evenly over "
        "the threads of one repeat, at level `weave`, for lights at "
        f"{', '.join(map(str, ELEVATIONS))} degrees of elevation and {AZIMUTHS} azimuths. "
        "Methods run in single precision. The reference is the height field marched in float64. "
        "The default `horizon` table has 16 azimuths and 8 texels along a thread in a cell."
    ),
    run=run,
)

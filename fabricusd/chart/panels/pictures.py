"""Panel: error of a path-traced picture against its time, by estimator, samples and level."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import plain
from fabricusd.appearance.levels import LEVELS
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.surface import far_all
from fabricusd.chart.panel import Panel, Row
from fabricusd.chart.scenes import one_cylinder
from fabricusd.chart.timing import in_turns, typical
from fabricusd.quality.pictures import difference
from fabricusd.reference.render import render_scene
from fabricusd.schema import load

Picture = NDArray[Any]

QUICK_PRESETS = ("polyester_satin_charmeuse",)
PRESETS = ("linen_plain", "polyester_satin_charmeuse")
ESTIMATORS = ("uniform", "surface", "light", "mis")
NAMES = {"surface": "BSDF", "mis": "MIS"}
SAMPLES = (4, 16, 64, 256)
QUICK_SAMPLES = (4, 16)
NOISES = (0.2, 0.1, 0.05)
QUICK_NOISES = (0.1,)


def run(quick: bool) -> list[Row]:
    """Two groups for each preset, on a cylinder that fills the picture."""
    rows = []
    for name in QUICK_PRESETS if quick else PRESETS:
        rows += _rows(name, quick) + _one_light(name, quick)
    return rows


def _one_light(name: str, quick: bool) -> list[Row]:
    """The cylinder under one distant light, without bounces: one call of the law is a picture."""
    real: Any = np.float32
    fabric, size = load(name), 24 if quick else 48
    wi, wo = _cylinder(size)
    i, o = (np.ascontiguousarray(w.T, real) for w in (wi, wo))
    out, double = np.empty_like(i), np.empty_like(i, np.float64)
    tables, exact = surface_tables(fabric, precision=real), surface_tables(fabric)

    def compiled() -> Picture:
        far_all(real, tables, i, o, out)
        return out.T

    def compiled_double() -> Picture:
        far_all(np.float64, exact, wi.T.copy(), wo.T.copy(), double)
        return double.T

    methods: dict[str, Callable[[], Any]] = {
        f"NumPy, {n} nodes a piece": partial(plain.far, fabric, wi, wo, per_segment=n)
        for n in (4, 16)
    }
    methods |= {"compiled, float32": compiled, "compiled, float64": compiled_double}
    reference = plain.far(fabric, wi, wo, per_segment=64 if quick else 256)
    taken = in_turns(methods, 2 if quick else 5)
    rows = []
    for method, run_once in methods.items():
        cost, spread = typical(taken[method])
        error = float(np.mean((run_once() - reference) ** 2) / np.mean(reference) ** 2)
        rows.append(
            Row(group=f"{name}, one light", method=method, cost=cost, cost_spread=spread,
                error=error)
        )  # fmt: skip
    return rows


def _cylinder(size: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(size^2, 3) directions to light and viewer in the surface frames of an upright cylinder.

    The viewer is far away. Places that face away from the light get a light just above the cloth.
    """
    across = (2 * (np.arange(size) + 0.5) / size - 1) * 0.98
    turn = np.tile(np.arcsin(across), size)
    c, s = np.cos(turn), np.sin(turn)
    frame = np.stack(
        (np.stack((c, 0 * c, -s), 1), np.stack((0 * c, 1 + 0 * c, 0 * c), 1),
         np.stack((s, 0 * c, c), 1)), 1
    )  # fmt: skip
    to_light, to_eye = np.array((0.48, 0.36, 0.8)), np.array((0.0, 0.0, 1.0))
    wi, wo = frame @ to_light, frame @ to_eye
    wi[:, 2] = np.maximum(wi[:, 2], 0.02)
    return wi / np.linalg.norm(wi, axis=1, keepdims=True), wo


def _settings(quick: bool) -> dict[str, dict[str, Any]]:
    """Method -> arguments of `render_scene`."""
    counts = QUICK_SAMPLES if quick else SAMPLES
    found: dict[str, dict[str, Any]] = {
        f"{NAMES.get(e, e)}, {n}": {"estimator": e, "spp": n} for e in ESTIMATORS for n in counts
    }
    for noise in QUICK_NOISES if quick else NOISES:
        found[f"MIS, --noise {noise:g}"] = {"noise": noise, "spp": 4 * counts[-1]}
    for level in LEVELS:
        found[f"MIS, level {level}, {counts[-1]}"] = {"level": level, "spp": counts[-1]}
    return found


def _rows(name: str, quick: bool) -> list[Row]:
    size, repeats, most = (24, 2, 512) if quick else (48, 3, 8192)
    scene = one_cylinder(load(name))

    def picture(seed: int, side: int = size, **settings: Any) -> tuple[Picture, float]:
        made = render_scene(
            scene, width=side, height=side, seed=seed, workers=1, pixel_filter="box", **settings
        )
        return made.layers["beauty"][..., :3], made.processor_seconds

    reference, _ = picture(1000, spp=most)
    settings = _settings(quick)
    for arguments in settings.values():
        # The first call compiles or loads the kernels.
        picture(0, 4, **{**arguments, "spp": 4})
    found: dict[str, list[tuple[float, ...]]] = {method: [] for method in settings}
    for seed in range(repeats):
        for method, arguments in settings.items():
            made, seconds = picture(seed, **arguments)
            d = difference(made, reference)
            found[method].append((seconds, d.relative_mse, d.flip, d.delta_e_mean))
    return [_row(name, method, np.array(values)) for method, values in found.items()]


def _row(name: str, method: str, values: NDArray[np.float64]) -> Row:
    """values : (repeats, 4) - seconds, relative MSE, FLIP, delta E 2000."""
    cost, cost_spread = typical(values[:, 0])
    error, error_spread = typical(values[:, 1])
    return Row(
        group=f"{name}, cylinder", method=method, cost=cost, cost_spread=cost_spread, error=error,
        error_spread=error_spread,
        figures={"flip": float(np.median(values[:, 2])), "delta_e": float(np.median(values[:, 3]))},
    )  # fmt: skip


PANEL = Panel(
    name="pictures",
    title="Pictures",
    cost="processor seconds, one worker",
    error="relative mean square error",
    about=(
        "The scene is a cylinder of cloth under a sky and a sun of 5°, at level `auto` unless the "
        "method names a level. The number in a method's name is the samples per pixel. The "
        "reference is a picture of many more samples by MIS, with another seed, at level `auto`, "
        "so the error of a method at another level includes the bias of that level. Preparation "
        "is not counted. `charts.csv` and `charts.json` also hold FLIP and delta E 2000 of the "
        "path-traced pictures. The group `one light` traces no paths: it evaluates level `far` "
        "for all pixels at once, in NumPy and compiled, and its reference is NumPy with 256 "
        "nodes per piece of a curve."
    ),
    run=run,
)

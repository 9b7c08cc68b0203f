"""Panel: error of a path-traced picture against its time, by estimator, samples and level."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.chart.panel import Panel, Row
from fabricusd.chart.scenes import one_cylinder
from fabricusd.chart.timing import typical
from fabricusd.quality.pictures import difference
from fabricusd.reference.render import render_scene
from fabricusd.schema import load

Picture = NDArray[np.float32]

QUICK_PRESETS = ("polyester_satin_charmeuse",)
PRESETS = ("linen_plain", "polyester_satin_charmeuse")
ESTIMATORS = ("uniform", "surface", "light", "mis")
NAMES = {"surface": "BSDF", "mis": "MIS"}
SAMPLES = (4, 16, 64, 256)
QUICK_SAMPLES = (4, 16)
NOISES = (0.2, 0.1, 0.05)
QUICK_NOISES = (0.1,)
LEVELS = ("far", "weave", "thread")


def run(quick: bool) -> list[Row]:
    """A group for each preset on a cylinder that fills the picture."""
    rows = []
    for name in QUICK_PRESETS if quick else PRESETS:
        rows += _rows(name, quick)
    return rows


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
        # Kernels are compiled, or loaded, when they are first called.
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
        "A cylinder of cloth under a sky and a sun of 5°, level `auto` unless named; the "
        "number is that of samples a pixel. Against a picture of many more samples by MIS, other "
        "seed; preparation is not counted. FLIP and delta E 2000 of every row are in the tables. "
        "A level's row holds its bias too: the reference's is `auto`."
    ),
    run=run,
)

"""Panel: a picture of the preview beside pictures of the path tracer without bounces."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.chart.panel import Panel, Row
from fabricusd.chart.timing import typical
from fabricusd.fabric import even
from fabricusd.preview.lights import Lights
from fabricusd.preview.picture import shaded
from fabricusd.preview.reference import scene_of
from fabricusd.preview.shapes import SHAPES
from fabricusd.preview.surfaces import Cloth
from fabricusd.preview.tables import tables_of
from fabricusd.quality.colors import delta_e_2000
from fabricusd.reference.render import render_scene
from fabricusd.schema import load

QUICK_CASES = (("linen_plain", "cylinder"),)
CASES = (*QUICK_CASES, ("linen_plain", "drape"), ("silk_shot", "cylinder"), ("denim", "cylinder"))
SAMPLES = (1, 4, 16, 64)
QUICK_SAMPLES = (1, 4)

Made = tuple[NDArray[Any], float]
"""A picture (h, w, 3), and the processor seconds that it took."""


def run(quick: bool) -> list[Row]:
    """One group for each fabric and shape."""
    return [row for case in (QUICK_CASES if quick else CASES) for row in _rows(*case, quick)]


def _rows(name: str, shape: str, quick: bool) -> list[Row]:
    size, repeats, most = (32, 2, 256) if quick else (96, 5, 1024)
    fabric, lights = even(load(name)), Lights()
    scene, made = scene_of(fabric, shape, lights), SHAPES[shape](fabric)
    worn, threads = [Cloth(tables_of(fabric))], made.threads(fabric)

    def traced(samples: int, seed: int) -> Made:
        found = render_scene(
            scene, width=size, height=size, spp=samples, max_bounces=0, level="far", seed=seed,
            workers=1,
        )  # fmt: skip
        return found.layers["beauty"], found.processor_seconds

    def previewed(samples: int, seed: int) -> Made:
        begun = time.process_time()
        found = shaded(
            made, threads, made.camera(), worn, "far", (size, size), lights, samples
        )  # fmt: skip
        return found.radiance, time.process_time() - begun

    reference, _ = traced(most, 1000)
    covered = reference[..., 3] > 0.99
    counts = QUICK_SAMPLES if quick else SAMPLES
    methods: Mapping[str, tuple[Callable[[int, int], Made], int]] = {
        f"{title}, {n}": (method, n)
        for title, method in (("preview", previewed), ("path tracer", traced))
        for n in counts
    }
    for method, n in methods.values():
        method(n, 0)  # the first call compiles or loads the kernels
    found: dict[str, list[tuple[float, float]]] = {title: [] for title in methods}
    for seed in range(repeats):
        for title, (method, n) in methods.items():
            picture, seconds = method(n, seed)
            differ: Any = delta_e_2000(
                np.asarray(picture[..., :3])[covered][None], reference[..., :3][covered][None]
            )
            found[title].append((seconds, float(differ.mean())))
    return [
        _row(f"{name} on a {shape}", title, np.array(values)) for title, values in found.items()
    ]


def _row(group: str, method: str, values: NDArray[np.float64]) -> Row:
    """values : (repeats, 2) - seconds, delta E 2000."""
    (cost, cost_spread), (error, error_spread) = (typical(column) for column in values.T)
    return Row(
        group=group, method=method, cost=cost, cost_spread=cost_spread, error=error,
        error_spread=error_spread,
    )  # fmt: skip


PANEL = Panel(
    name="previews",
    title="Previews",
    cost="processor seconds, one worker",
    error="mean delta E 2000",
    about=(
        "`fabricusd preview` and the path tracer draw the same triangles under the same key light "
        "and sky, at level `far` without bounces. The number in a method's name is the samples per "
        "pixel. The reference is a picture by the path tracer of 1024 samples, and the error is "
        "the mean over covered pixels. Preparation is not counted."
    ),
    run=run,
)

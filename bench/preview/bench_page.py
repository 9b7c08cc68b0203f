"""The page beside the surface laws, in headless Chromium with WebGL2 in software.

python bench/preview/bench_page.py [--presets NAME ...]

For each preset: how long the first frame took, and quantiles of the relative error of PAIRS pairs
of directions to `surface.evaluate`, at levels `far` and `weave`. Threads are even on both sides.
`bench_page_error.py` compares pictures.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from fabricusd.appearance import surface
from fabricusd.fabric import Fabric, even
from fabricusd.preview.fabrics import fabric_of
from fabricusd.preview.page.make import FOLDER, page
from tests.preview.browser import Shown, chromium
from tests.preview.test_page import PAIRS as SHADER

WIDTH, HEIGHT = 512, 256
PAIRS = WIDTH * HEIGHT
LEVELS = ("far", "weave")


def pairs(shown: Shown, fabric: Fabric, level: str) -> np.ndarray:
    """(PAIRS,) relative errors of the page's values."""
    rng = np.random.default_rng(0)
    wi, wo = rng.normal(size=(2, PAIRS, 3))
    for w in (wi, wo):
        w[:, 2] = np.abs(w[:, 2])
        w /= np.linalg.norm(w, axis=1, keepdims=True)
    i, o, uv = (x.astype(np.float32) for x in (wi, wo, rng.uniform(0, 30, (PAIRS, 2))))
    number = LEVELS.index(level)
    found = shown.floats(
        f"(viewer.level = {number}, viewer.evaluate(a.i, a.o, {WIDTH}, {HEIGHT}))",
        i=np.concatenate((i, uv[:, :1]), axis=1), o=np.concatenate((o, uv[:, 1:]), axis=1),
    ).reshape(PAIRS, 4)[:, :3]  # fmt: skip
    unit = [x.astype(float) for x in (i, o)]
    unit = [x / np.linalg.norm(x, axis=1, keepdims=True) for x in unit]
    shadow = "horizon" if number else surface.mean_shadow(fabric)
    wanted = surface.evaluate(fabric, *unit, uv.astype(float) if number else None, level, shadow)
    brightest = wanted.max(axis=1, keepdims=True)
    least = 1e-3 * np.median(brightest[brightest > 0])
    return np.asarray((np.abs(found - wanted) / np.maximum(brightest, least)).max(axis=1))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presets", nargs="*", default=["linen_plain", "denim", "velvet"])
    options = parser.parse_args()
    kernels = (FOLDER / "kernels.glsl").read_text() + (FOLDER / "cloth.glsl").read_text()
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        for name in options.presets:
            fabric = even(fabric_of(name)[0])
            path = Path(folder) / "page.html"
            path.write_text(page(fabric))
            begun = time.perf_counter()
            shown = Shown(browser, path, (640, 256))
            took, load = time.perf_counter() - begun, os.getloadavg()[0]
            print(f"{name}: first frame after {took:.2f} s, at a load of {load:.1f}")
            shown.tab.evaluate("t => { fabricusd.viewer.shaders.pairs = t; }", kernels + SHADER)
            for level in LEVELS:
                error = pairs(shown, fabric, level)
                parts = [f"{np.quantile(error, q):.1e}" for q in (0.5, 0.99, 0.999, 1.0)]
                print(f"| {name} | {level} | {' | '.join(parts)} |", flush=True)
            shown.tab.close()


if __name__ == "__main__":
    main()

"""The page beside the surface laws and the path tracer, in headless Chromium with software WebGL2.

python bench/preview/bench_page.py [--presets NAME ...] [--size 64] [--frames 64]

For each preset: quantiles of the relative error of PAIRS pairs of directions to
`surface.evaluate`, at levels `far` and `weave`; then, per shape and level, the mean delta E 2000 of
the page after some frames to a path-traced picture of SAMPLES samples without bounces, over the
whole picture and over what the shape covers. Threads are even on both sides.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from fabricusd.appearance import surface
from fabricusd.fabric import Fabric, even
from fabricusd.preview.fabrics import fabric_of
from fabricusd.preview.lights import Lights
from fabricusd.preview.page.make import FOLDER, page
from fabricusd.preview.picture import Picture
from fabricusd.preview.reference import reference_picture
from fabricusd.quality.colors import delta_e_2000
from fabricusd.srgb import srgb_decode
from tests.preview.browser import Shown, chromium
from tests.preview.test_page import PAIRS as SHADER

WIDTH, HEIGHT = 512, 256
PAIRS = WIDTH * HEIGHT
SAMPLES = 256
SHAPES, LEVELS = ("cylinder", "sphere"), ("far", "weave")


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


def drawn(shown: Shown, shape: str, level: str, size: int, frames: int) -> Picture:
    """What the page shows after some frames."""
    radiance = shown.floats(
        f"(document.getElementById('shape').value = '{shape}',"
        "document.getElementById('shape').onchange(),"
        f"viewer.resize({size}, {size}), viewer.level = {LEVELS.index(level)}, viewer.frames = 0,"
        f"[...Array({frames})].forEach("
        "() => viewer.draw(fabricusd.placed(), fabricusd.lights())),"
        "viewer.read())"
    ).reshape(size, size, 4)
    shown.rest()
    return Picture(radiance=radiance[..., :3], cover=radiance[..., 3])


def differences(a: Picture, b: Picture) -> tuple[float, float]:
    """Mean delta E 2000 over the picture, and over what both cover."""
    mine, theirs = (srgb_decode(p.codes() / 255.0) for p in (a, b))
    found: Any = delta_e_2000(mine, theirs)
    return float(found.mean()), float(found[(a.cover > 0.99) & (b.cover > 0.99)].mean())


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presets", nargs="*", default=["linen_plain", "denim", "velvet"])
    parser.add_argument("--size", type=int, default=64)
    parser.add_argument("--frames", type=int, default=64)
    options = parser.parse_args()
    kernels = (FOLDER / "kernels.glsl").read_text() + (FOLDER / "cloth.glsl").read_text()
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        for name in options.presets:
            fabric = even(fabric_of(name)[0])
            path = Path(folder) / "page.html"
            path.write_text(page(fabric))
            begun = time.perf_counter()
            shown = Shown(browser, path, (640, 256))
            print(f"{name}: first frame after {time.perf_counter() - begun:.2f} s")
            shown.tab.evaluate("t => { fabricusd.viewer.shaders.pairs = t; }", kernels + SHADER)
            for level in LEVELS:
                error = pairs(shown, fabric, level)
                parts = [f"{np.quantile(error, q):.1e}" for q in (0.5, 0.99, 0.999, 1.0)]
                print(f"| {name} | {level} | {' | '.join(parts)} |", flush=True)
            for shape in SHAPES:
                for level in LEVELS:
                    found, _ = reference_picture(
                        fabric, shape=shape, level=level, size=options.size, lights=Lights(),
                        spp=SAMPLES,
                    )  # fmt: skip
                    wanted = Picture(radiance=found[..., :3], cover=found[..., 3])
                    mine = drawn(shown, shape, level, options.size, options.frames)
                    whole, covered = differences(mine, wanted)
                    print(
                        f"| {name} | {shape} | {level} | {whole:.2f} | {covered:.2f} |", flush=True
                    )
            shown.tab.close()


if __name__ == "__main__":
    main()

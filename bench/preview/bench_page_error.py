"""How far the page is from the path tracer, by light and by number of frames, in headless Chromium.

python bench/preview/bench_page_error.py [--presets NAME ...] [--shapes cylinder ...]
    [--levels far weave] [--lights key sky] [--frames 64] [--size 64] [--samples 2048] [--passes 4]

One row for each preset, shape, level and light: the mean delta E 2000 over the covered pixels after
some frames, and the noise of the reference, as half of what its two halves are apart. Light does
not bounce, and threads are even on both sides. `--shapes skirt` is the sample garment.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from fabricusd.fabric import Binding, Fabric, even
from fabricusd.preview.fabrics import fabric_of, names_of_presets
from fabricusd.preview.lights import Lights
from fabricusd.preview.page.make import page
from fabricusd.preview.picture import Picture
from fabricusd.preview.reference import scene_of_shape
from fabricusd.preview.scenes import shape_of_scene
from fabricusd.preview.shapes import SHAPES, Shape
from fabricusd.quality.colors import delta_e_2000
from fabricusd.reference.render import render_scene
from fabricusd.samples.write import write_samples
from fabricusd.srgb import srgb_decode
from tests.preview.browser import Shown, chromium

LEVELS = ("far", "weave", "thread")
LIT = {
    "key": Lights(zenith=0.0, nadir=0.0), "sky": Lights(key=0.0), "both": Lights(),
}  # fmt: skip


def reference(
    fabric: Fabric, shape: Shape, level: str, lights: Lights, size: int, samples: int
) -> tuple[Picture, float]:
    """(A picture without bounces, delta E 2000 of its noise)."""
    scene = scene_of_shape(Binding(fabric=fabric, metres_per_uv=1.0), shape, lights, shape.camera())
    halves = []
    for seed in (1, 2):
        found = render_scene(
            scene, width=size, height=size, spp=samples // 2, max_bounces=0, level=level,
            shadow="horizon", seed=seed,
        ).layers["beauty"]  # fmt: skip
        halves.append(Picture(radiance=found[..., :3], cover=found[..., 3]))
    one, two = halves
    mean = Picture(
        radiance=0.5 * (one.radiance + two.radiance), cover=0.5 * (one.cover + two.cover)
    )
    return mean, 0.5 * differences(one, two)


def differences(a: Picture, b: Picture) -> float:
    """Mean delta E 2000 over what both cover."""
    mine, theirs = (srgb_decode(p.codes() / 255.0) for p in (a, b))
    found: Any = delta_e_2000(mine, theirs)
    return float(found[(a.cover > 0.99) & (b.cover > 0.99)].mean())


def stop(shown: Shown) -> None:
    """Let a page draw only when asked, after the frame that it waits for."""
    shown.tab.evaluate(
        "new Promise(done => { const next = window.requestAnimationFrame;"
        "window.requestAnimationFrame = () => 0; next(done); })"
    )


def drawn(
    shown: Shown, shape: str, level: str, lights: Lights, size: int, frames: list[int], passes: int
) -> tuple[list[Picture], float]:
    """(What the page shows after each number of frames, milliseconds of a frame)."""
    shown.tab.evaluate(
        "([shape, size, level, passes]) => {"
        "const { viewer } = fabricusd, e = document.getElementById('shape');"
        "e.value = shape; e.onchange(); viewer.resize(size, size);"
        "Object.assign(viewer, { level, passes, frames: 0 });"
        "window.draws = (n, lights) => { const begun = performance.now();"
        "while (viewer.frames < n) viewer.draw(fabricusd.placed(), lights); viewer.read();"
        "return performance.now() - begun; }; }",
        [shape, size, LEVELS.index(level), passes],
    )
    said = {"key_power": lights.key, "even": lights.even, "slope": lights.slope}
    pictures, took = [], 0.0
    for n in frames:
        took += shown.tab.evaluate("([n, lights]) => draws(n, lights)", [n, said])
        values = shown.floats("viewer.read()").reshape(size, size, 4)
        pictures.append(Picture(radiance=values[..., :3], cover=values[..., 3]))
    shown.rest()
    return pictures, took / frames[-1]


def meshes(fabric: Fabric, skirt: Path) -> dict[str, Shape]:
    """Shapes by the names that they have on the page."""
    _, garment = shape_of_scene(str(skirt), fabric, None, 1.0, "cm").cloth(str(skirt))
    return {"scene": garment, **{name: make(fabric) for name, make in SHAPES.items()}}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presets", nargs="*", default=None, help="default: all")
    parser.add_argument("--shapes", nargs="*", default=["cylinder", "sphere", "skirt"])
    parser.add_argument("--levels", nargs="*", default=["far", "weave"], choices=LEVELS)
    parser.add_argument("--lights", nargs="*", default=["key", "sky"], choices=list(LIT))
    parser.add_argument("--frames", nargs="*", type=int, default=[64])
    parser.add_argument("--size", type=int, default=64)
    parser.add_argument("--samples", type=int, default=2048, help="of a pixel of the reference")
    parser.add_argument("--passes", type=int, default=4, help="of a frame, with two samples each")
    options = parser.parse_args()
    counts = " | ".join(f"{n} frames" for n in options.frames)
    print(f"| preset | shape | level | light | {counts} | reference's noise | ms a frame |")
    print("|---" * (6 + len(options.frames)) + "|", flush=True)
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        write_samples(Path(folder))
        for name in options.presets or names_of_presets():
            fabric = even(fabric_of(name)[0])
            shapes = meshes(fabric, Path(folder) / "skirt.obj")
            path = Path(folder) / "page.html"
            path.write_text(page(fabric, mesh=shapes["scene"]))
            shown = Shown(browser, path, (200, 200))
            stop(shown)
            for shape in options.shapes:
                on_page = "scene" if shape == "skirt" else shape
                for level in options.levels:
                    for light in options.lights:
                        wanted, noise = reference(
                            fabric, shapes[on_page], level, LIT[light], options.size,
                            options.samples,
                        )  # fmt: skip
                        mine, took = drawn(
                            shown, on_page, level, LIT[light], options.size, options.frames,
                            options.passes,
                        )  # fmt: skip
                        row = " | ".join(f"{differences(p, wanted):.2f}" for p in mine)
                        print(
                            f"| {name} | {shape} | {level} | {light} | {row} | {noise:.2f} | "
                            f"{took:.0f} |",
                            flush=True,
                        )
            shown.tab.close()
    print(f"load {os.getloadavg()[0]:.1f}", file=sys.stderr)


if __name__ == "__main__":
    main()

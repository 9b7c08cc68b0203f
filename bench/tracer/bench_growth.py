"""How time and memory grow with samples, pixels, triangles, threads, lights, instances and texels.

    python bench/tracer/bench_growth.py [--only samples pixels …]

Each row is a process of its own, so that its peak memory is that of the row; what a process takes
that has nothing to render stands first. Times are processor seconds of all workers, which a busy
machine changes less than wall time. The slope is that of the logarithms between a row and the one
before, of what each takes beyond a process that has nothing to render: 1 is in proportion, 0 is no
growth, and nothing stands where that is within the noise. Kernels are compiled by a first pass that
is not shown; tables of an axis's later rows are part of their times.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

AXES: dict[str, tuple[str, tuple[int, ...]]] = {
    "nothing": ("1 sample of 16 x 16 pixels", (1,)),
    "samples": ("a pixel, 256 x 256", (16, 64, 256, 1024)),
    "pixels": ("a side, 4 samples", (512, 1024, 2048, 4096)),
    "triangles": ("256 x 256, 16 samples", (10_000, 100_000, 1_000_000, 4_000_000)),
    "threads": ("of a repeat of chance, a side; level weave", (8, 64, 512, 2048)),
    "lights": ("spheres, 16 samples", (1, 4, 16, 64, 256)),
    "instances": ("of 12 triangles, 16 samples", (10, 1_000, 100_000, 1_000_000)),
    "texels": ("a side, baked", (256, 512, 1024, 2048)),
}
"""Of each axis, what is counted, and how many."""


def picture(
    side: int = 256, spp: int = 16, triangles: int = 10_000, threads: int = 0, lights: int = 0
) -> None:
    """Render a wavy square of cloth."""
    import bench_memory

    from fabricusd.fabric import Binding, Weave
    from fabricusd.reference.render import render_scene
    from fabricusd.scene.light_kinds import DOME, SPHERE
    from fabricusd.scene.scene import FabricSurface, Light, Scene
    from fabricusd.schema import load

    bench_memory.POINTS = round(math.sqrt(triangles / 2)) + 1
    fabric = load("silk_shot")
    if threads:
        cells = np.random.default_rng(1).random((threads, threads)) < 0.5
        fabric = replace(fabric, weave=Weave(cells, "chance"))
    sky = Light(path="sky", kind=DOME, radiance=(1.0, 1.0, 1.0))
    turns = np.arange(lights) * (2.0 * math.pi / max(lights, 1))
    lamps = [
        Light(
            path=f"lamp{k}", kind=SPHERE, radiance=(20.0, 20.0, 20.0),
            frame=placed(1.5 * math.cos(turn), 1.2, 1.5 * math.sin(turn)), radius=0.05,
        )
        for k, turn in enumerate(turns)
    ]  # fmt: skip
    scene = Scene(
        meshes=[bench_memory.wavy()],
        materials=[FabricSurface(binding=Binding(fabric=fabric, metres_per_uv=1.0))],
        lights=lamps or [sky],
    )
    render_scene(scene, width=side, height=side, spp=spp, level="weave" if threads else "far")


def placed(x: float, y: float, z: float) -> Any:
    """A frame that is only moved."""
    frame = np.eye(4)
    frame[:3, 3] = x, y, z
    return frame


def instances(count: int) -> None:
    """Render `count` placements of one small mesh."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scene"))
    from bench_instances import write_stage

    from fabricusd.reference.render import render_scene
    from fabricusd.scene.read import read_scene
    from fabricusd.scene.staging import Staging, put

    with tempfile.TemporaryDirectory() as folder:
        path = write_stage(Path(folder), count, small=True, native=False)
        scene = read_scene(str(path), instanced=True)
        put(Staging(frame="/"), scene, 1.0)
        render_scene(scene, width=256, height=256, spp=16)


def texels(side: int) -> None:
    """Bake the sample skirt."""
    from fabricusd import bake
    from fabricusd.samples.write import write_samples

    with tempfile.TemporaryDirectory() as folder:
        skirt = write_samples(Path(folder))[0]
        bake(skirt, f"{folder}/baked", fabric="silk_shot", units="cm", fit=True, resolution=side)


RUNS: dict[str, Callable[[int], None]] = {
    "nothing": lambda n: picture(16, n),
    "samples": lambda n: picture(spp=n),
    "pixels": lambda n: picture(side=n, spp=4),
    "triangles": lambda n: picture(triangles=n),
    "threads": lambda n: picture(threads=n),
    "lights": lambda n: picture(lights=n),
    "instances": instances,
    "texels": texels,
}


def measure(axis: str, count: int) -> None:
    """Do one row, and print what it took."""
    begun = time.perf_counter()
    RUNS[axis](count)
    used = resource.getrusage(resource.RUSAGE_SELF)
    unit = 1 if sys.platform == "darwin" else 1024
    print(json.dumps({
        "wall": time.perf_counter() - begun, "busy": used.ru_utime + used.ru_stime,
        "peak": used.ru_maxrss * unit / 1e9,
    }))  # fmt: skip


def row(axis: str, count: int) -> dict[str, float]:
    """What one row took."""
    run = [sys.executable, __file__, "--measure", axis, str(count)]
    done = subprocess.run(run, check=True, capture_output=True, text=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def processor() -> str:
    """The name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def main() -> None:
    """Print a table of every axis."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--only", nargs="*", choices=list(AXES), default=list(AXES))
    options.add_argument("--measure", nargs=2, help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.measure:
        measure(given.measure[0], int(given.measure[1]))
        return
    print(f"{processor()}\n")
    print("| | count | s of processor | slope | s of wall | peak GB | slope |")
    print("|---|---|---|---|---|---|---|")
    row("nothing", 1)
    base = row("nothing", 1)
    for axis in given.only:
        what, counts = AXES[axis]
        row(axis, counts[0])
        last: tuple[int, dict[str, float]] | None = None
        for count in counts:
            now = row(axis, count)
            slopes = ["", ""]
            if last is not None:
                steps = math.log(count / last[0])
                slopes = [slope(key, now, last[1], base, steps) for key in ("busy", "peak")]
            head = f"{axis}, {what}" if last is None else ""
            print(
                f"| {head} | {count} | {now['busy']:.1f} | {slopes[0]} | {now['wall']:.1f} | "
                f"{now['peak']:.2f} | {slopes[1]} |",
                flush=True,
            )
            last = count, now


NOISE = {"busy": 0.3, "peak": 0.03}
"""What two runs of a row may differ by: seconds, and GB."""


def slope(
    key: str, now: dict[str, float], last: dict[str, float], base: dict[str, float], steps: float
) -> str:
    """The slope of one column between two rows; "" where a row is within the noise of `base`."""
    high, low = now[key] - base[key], last[key] - base[key]
    return f"{math.log(high / low) / steps:.2f}" if min(high, low) > NOISE[key] else ""


if __name__ == "__main__":
    main()

"""The preview beside the path tracer: time and difference, for every preset and shape.

python bench/preview/bench_preview.py [--presets NAME ...] [--shapes NAME ...] [--json FILE]

The difference is the mean delta E 2000 over the pixels that the shape covers, to a path-traced
picture of REFERENCE samples without bounces. `render` is the processor time of the path tracer's
sampling at the samples at which it differs as much, and `noise` what the noise of the REFERENCE
samples contributes; both are read off the line through its differences at FEW samples, in
logarithms. `wall` and `cpu` are those of the whole command, Python included, the fastest of REPEATS
runs after a first.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from fabricusd.preview.fabrics import fabric_of, names_of_presets
from fabricusd.preview.lights import Lights
from fabricusd.preview.picture import Picture, preview
from fabricusd.preview.reference import reference_picture
from fabricusd.preview.shapes import SHAPES
from fabricusd.quality.colors import delta_e_2000
from fabricusd.srgb import srgb_decode

SIZE, REFERENCE, FEW, REPEATS = 96, 256, (4, 32), 2
COMMAND_SIZE = 512


def light_of(picture: Picture) -> np.ndarray:
    """(h, w, 3) display light of the picture as it is shown."""
    return srgb_decode(picture.codes() / 255.0)


def difference(a: Picture, b: Picture) -> float:
    """Mean delta E 2000 over the pixels that both cover."""
    both = (a.cover > 0.99) & (b.cover > 0.99)
    return float(delta_e_2000(light_of(a)[both], light_of(b)[both]).mean())


def traced(fabric: Any, shape: str, spp: int, seed: int) -> tuple[Picture, float]:
    """A path-traced picture at level `far`, and the processor time of its sampling [s]."""
    found, seconds = reference_picture(
        fabric, shape=shape, level="far", size=SIZE, lights=Lights(), spp=spp, seed=seed
    )
    return Picture(radiance=found[..., :3], cover=found[..., 3]), seconds


def command(name: str, shape: str, out: Path) -> tuple[float, float]:
    """(wall, processor) seconds of `fabricusd preview`."""
    given = ["preview", name, "--shape", shape, "--level", "far", "--size", str(COMMAND_SIZE)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.perf_counter()
    subprocess.run([sys.executable, "-m", "fabricusd", *given, "-q", "-o", str(out)], check=True)
    wall = time.perf_counter() - begun
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def row(name: str, shape: str, out: Path) -> dict[str, Any]:
    """All figures of a preset on a shape."""
    fabric, _ = fabric_of(name)
    wanted, _ = traced(fabric, shape, REFERENCE, 0)
    rough = [traced(fabric, shape, spp, 1 + k) for k, spp in enumerate(FEW)]
    differences = [difference(picture, wanted) for picture, _ in rough]
    slope = np.diff(np.log(differences))[0] / np.diff(np.log(FEW))[0]
    mine = difference(preview(fabric, shape=shape, level="far", size=SIZE), wanted)
    samples = FEW[-1] * (mine / differences[-1]) ** (1.0 / slope)
    per_sample = rough[-1][1] / FEW[-1] * (COMMAND_SIZE / SIZE) ** 2
    times = [command(name, shape, out) for _ in range(1 + REPEATS)][1:]
    return {
        "preset": name, "shape": shape, "difference": mine,
        "noise": float(differences[-1] * (REFERENCE / FEW[-1]) ** slope),
        "render": float(samples * per_sample),
        "wall": min(w for w, _ in times), "cpu": min(c for _, c in times),
    }  # fmt: skip


def main() -> None:
    """Print a table, and write it as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presets", nargs="*", default=names_of_presets())
    parser.add_argument("--shapes", nargs="*", default=list(SHAPES))
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print("| preset | shape | ΔE2000 | noise | render [s] | wall [s] | cpu [s] |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name in options.presets:
            for shape in options.shapes:
                found = row(name, shape, Path(folder) / "a.png")
                rows.append(found)
                print(
                    f"| {name} | {shape} | {found['difference']:.2f} | {found['noise']:.2f} | "
                    f"{found['render']:.2g} | {found['wall']:.2f} | {found['cpu']:.2f} |",
                    flush=True,
                )
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()

"""What denoising costs and gains: error against converged pictures, of garments and of threads.

    python bench/tracer/bench_denoise.py [--samples 16] [--reference 512] [--size 480]

The error is the mean over pixels of (a - b)^2 / (b^2 + 0.01), b being converged with another seed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from fabricusd.reference import render
from fabricusd.reference.denoise import GUIDES, denoised, smoothed

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "samples"))

PLANE = """v -1 0 0
v 1 0 0
v 1 2 0
v -1 2 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
f 1/1 2/2 3/3 4/4
"""
"""Two units wide; linen of 15 threads/cm, seen by a camera that frames it."""

SWATCHES = {"linen, 5 cm": "in", "linen, 2 cm": "cm", "linen, 2 mm": "mm"}


def relative_error(a: np.ndarray, b: np.ndarray) -> float:
    """Mean of (a - b)^2 / (b^2 + 0.01)."""
    return float(np.mean((a - b) ** 2 / (b**2 + 0.01)))


def measure(
    name: str, scene: str, samples: int, reference: int, side: int, **settings: object
) -> None:
    """Print a row of the table in docs/review.md."""
    size = {"width": side, "height": side}
    noisy = render(scene, spp=samples, aovs=GUIDES, **size, **settings)
    exact = render(scene, spp=reference, seed=1, **size, **settings).layers["beauty"][..., :3]
    began = time.perf_counter()
    smooth = denoised(noisy.layers)
    seconds = time.perf_counter() - began
    pictures = (noisy.layers["beauty"][..., :3], smoothed(noisy.layers), smooth)
    errors = " | ".join(f"{relative_error(picture, exact):.2g}" for picture in pictures)
    print(f"| {name} | {samples} | {errors} | {seconds:.2g} s |", flush=True)


def main() -> None:
    """Measure a garment and two swatches."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--reference", type=int, default=512)
    parser.add_argument("--size", type=int, default=480)
    options = parser.parse_args()
    from make_samples import make_skirt

    with tempfile.TemporaryDirectory() as folder:
        print("| picture | samples | noisy | by the denoiser alone | as written | time |")
        print("|---|---|---|---|---|---|")
        skirt = str(make_skirt(Path(folder)))
        how = (options.samples, options.reference, options.size)
        measure("satin skirt", skirt, *how)
        (Path(folder) / "swatch.obj").write_text(PLANE)
        for name, units in SWATCHES.items():
            measure(name, f"{folder}/swatch.obj", *how, fabric="linen_plain", units=units)


if __name__ == "__main__":
    main()

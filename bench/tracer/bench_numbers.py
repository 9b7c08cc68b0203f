"""Error saved by the path tracer's Sobol' numbers, accuracy of `variance`, and effect of `--noise`.

    python bench/tracer/bench_numbers.py [--reference 4096]

The scenes are the draped cloth and the cylinders of `samples` at 120 x 80. Relative MSE is the
squared error over the squared picture, which is at least a hundredth of its mean. `stated` is the
variance in the picture's own layer over its actual squared error. The second table gives the
samples that `--noise` takes, and the error that it leaves, rms over all pixels.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from fabricusd.reference.render import render_scene
from fabricusd.scene.read import read_scene

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "samples"))

SEEDS = {16: 4, 64: 4, 256: 2}
NOISE = (0.1, 0.05, 0.03)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--reference", type=int, default=4096, help="samples of the exact picture")
    options = parser.parse_args()
    from make_samples import make_cylinders, make_drape

    size = {"width": 120, "height": 80, "aovs": ("beauty", "variance")}
    stops = ["| scene | noise | samples a pixel | relative error |", "|---|---|---|---|"]
    print("| scene | samples | relative MSE, independent | Sobol' | ratio | stated |")
    print("|---|---|---|---|---|---|")
    for name, make in (("drape", make_drape), ("cylinders", make_cylinders)):
        with tempfile.TemporaryDirectory() as folder:
            scene = read_scene(make(Path(folder)))
        exact = render_scene(scene, spp=options.reference, seed=99, **size).layers["beauty"]
        exact = exact[..., :3].astype(float)
        scale = exact**2 + (0.01 * exact.mean()) ** 2
        for spp, seeds in SEEDS.items():
            error = {"random": 0.0, "sobol": 0.0}
            stated = 0.0
            for sampler in error:
                for seed in range(seeds):
                    layers = render_scene(scene, spp=spp, seed=seed, sampler=sampler, **size).layers
                    gap = layers["beauty"][..., :3] - exact
                    error[sampler] += float((gap**2 / scale).mean()) / seeds
                    if sampler == "sobol":
                        stated += float((layers["variance"] / scale).mean()) / seeds
            loose, even = error["random"], error["sobol"]
            print(
                f"| {name} | {spp} | {loose:.2e} | {even:.2e} | {loose / even:.1f} "
                f"| {stated / np.float64(even):.1f} |"
            )
        for noise in NOISE:
            r = render_scene(scene, noise=noise, seed=0, **size)
            gap = r.layers["beauty"][..., :3] - exact
            left = np.sqrt((gap**2 / scale).mean())
            stops.append(f"| {name} | {noise} | {r.samples:.0f} | {left:.3f} |")
    print("\n" + "\n".join(stops))


if __name__ == "__main__":
    main()

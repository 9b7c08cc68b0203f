"""What bounces at translucent cloth cost, and what a bound on them loses, on the lit samples.

    python bench/tracer/bench_translucent.py [SCENE ...] [--size N] [--spp N] [--reference N]

Each picture is rendered under several bounds, one after another in each of three rounds, and
compared with one of many samples without a bound. `lacks` is what a picture has less than that one,
for each path that met a surface, and `cut off` what the run says. The furnace is the skirt of white
cloth that conserves energy, without a floor, in a white sky: whatever is not lost makes it 1.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from fabricusd.reference.render import render_scene
from fabricusd.scene.light_kinds import DOME
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import FabricSurface, Light, Scene

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "samples"))

BOUNDS = (0, 2, 4, 8, 16, 32, 64, 256)
ROUNDS = 3


def furnace(scene: Scene) -> Scene:
    """The meshes that wear a fabric, in white, in a white sky."""
    kept = [k for k, one in enumerate(scene.materials) if isinstance(one, FabricSurface)]
    materials = []
    for one in scene.materials:
        if isinstance(one, FabricSurface):
            fabric = one.binding.fabric
            white = {n: replace(t, albedo=(1.0,) * 3) for n, t in fabric.threads.items()}
            binding = replace(one.binding, fabric=replace(fabric, threads=white))
            one = replace(one, binding=binding)
        materials.append(one)
    meshes = [mesh for mesh in scene.meshes if np.isin(mesh.material, kept).all()]
    sky = Light(path="sky", kind=DOME, radiance=(1.0, 1.0, 1.0))
    return replace(scene, meshes=meshes, materials=materials, lights=[sky])


def compare(name: str, scene: Scene, size: int, spp: int, reference: int) -> None:
    """Print a row for each bound."""
    settings = {"width": size, "height": size, "level": "far", "workers": 2}

    def shown(bound: int, samples: int, seed: int = 0):
        return render_scene(scene, max_translucent=bound, spp=samples, seed=seed, **settings)

    truth = shown(1024, reference, seed=9)
    met = truth.layers["beauty"][..., 3].sum()
    true = truth.layers["beauty"][..., :3]
    times = {bound: [] for bound in BOUNDS}
    made = {}
    for _ in range(ROUNDS):
        for bound in BOUNDS:
            made[bound] = shown(bound, spp)
            times[bound].append(made[bound].processor_seconds)
    print(f"{name}: mean {true.mean():.4f}, {reference} samples; reference cut {truth.cut:.1e}")
    print("| bound | lacks | cut off | M rays | processor seconds | relative MSE |")
    for bound, result in made.items():
        got = result.layers["beauty"][..., :3]
        lacks = (true - got).mean(axis=-1).sum() / met
        error = np.mean((got - true) ** 2 / (true**2 + (0.01 * true.mean()) ** 2))
        print(
            f"| {bound} | {lacks:.4f} | {result.cut:.4f} | {result.rays / 1e6:.2f} "
            f"| {np.median(times[bound]):.2f} | {error:.2e} |"
        )


def main() -> None:
    """Make the scenes and compare the bounds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=["furnace", "lit_skirt", "lit_drape"])
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--reference", type=int, default=1024)
    options = parser.parse_args()
    import lit_from_behind
    import make_samples

    make_samples.fitted_looks = lambda fabric: None
    with tempfile.TemporaryDirectory() as folder:
        for name in options.scenes:
            make = lit_from_behind.make_lit_drape if "drape" in name else (
                lit_from_behind.make_lit_skirt
            )  # fmt: skip
            scene = read_scene(make(Path(folder)))
            scene = furnace(scene) if name == "furnace" else scene
            compare(name, scene, options.size, options.spp, options.reference)


if __name__ == "__main__":
    main()

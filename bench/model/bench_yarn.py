"""What uneven yarn costs.

    python bench/model/bench_yarn.py

Processor time of pictures of flat cloth with uneven threads over that with even ones, by level and
shadow, one worker, the fastest of several runs each; then nanoseconds a place of the map itself.
"""

from __future__ import annotations

import argparse
import time

import numba
import numpy as np

from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.appearance.weave.lookup import find_all
from fabricusd.appearance.weave.yarn.compiled import compile_yarn
from fabricusd.appearance.weave.yarn.lay import laid
from fabricusd.fabric import Binding, Fabric, even
from fabricusd.reference.render import render_scene
from fabricusd.scene.light_kinds import DISTANT, DOME
from fabricusd.scene.scene import Camera, FabricSurface, Light, Mesh, Scene
from fabricusd.schema import load

PRESETS = ("linen_plain", "polyester_satin_charmeuse", "rayon_shantung", "wool_flannel")
SIDE, SPP, THREADS = 320, 32, 60.0


def seconds(fabric: Fabric, level: str, shadow: str) -> float:
    """Processor seconds of one picture of THREADS threads from above."""
    size = THREADS * max(fabric.warp.pitch, fabric.weft.pitch)
    points = size * np.array([(-1.0, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)])
    triangles = np.array([(0, 1, 2), (0, 2, 3)])
    plane = np.stack((points[:, 0], -points[:, 2]), axis=1)
    frame = np.eye(4)
    frame[:3, :3] = np.array([(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)])
    frame[1, 3] = 1.0
    key = np.eye(4)
    key[:3, :3] = np.array([(0.8, 0.0, 0.6), (-0.36, 0.8, 0.48), (-0.48, -0.6, 0.64)]).T
    scene = Scene(
        meshes=[
            Mesh(path="cloth", points=points, triangles=triangles, uv=plane[triangles],
                 material=np.zeros(2, np.int32))
        ],
        materials=[FabricSurface(binding=Binding(fabric=fabric, metres_per_uv=1.0))],
        lights=[
            Light(path="sun", kind=DISTANT, radiance=(3.0,) * 3, frame=key),
            Light(path="sky", kind=DOME, radiance=(0.3,) * 3),
        ],
        camera=Camera(frame=frame, orthographic=True, aperture=(size, size)),
    )  # fmt: skip
    made = render_scene(
        scene, width=SIDE, height=SIDE, spp=SPP, level=level, shadow=shadow, max_bounces=1,
        workers=1,
    )  # fmt: skip
    return made.processor_seconds


def pictures(repeats: int) -> None:
    """Print the cost by preset, level and shadow."""
    print(f"{'preset':28}{'level':8}{'shadow':10}{'even s':>8}{'uneven s':>10}{'ratio':>8}")
    for name in PRESETS:
        uneven = load(name)
        cloths = (even(uneven), uneven)
        for level, shadow in (
            ("far", "none"), ("weave", "none"), ("weave", "horizon"), ("thread", "horizon"),
        ):  # fmt: skip
            best = [np.inf, np.inf]
            for _ in range(repeats):
                # In turns, so that a busy machine is busy for both.
                for k, fabric in enumerate(cloths):
                    best[k] = min(best[k], seconds(fabric, level, shadow))
            ratio = best[1] / best[0]
            print(f"{name:28}{level:8}{shadow:10}{best[0]:8.3f}{best[1]:10.3f}{ratio:8.2f}")


def places(count: int, repeats: int) -> None:
    """Print nanoseconds a place of the map and of the lookup, one worker."""
    numba.set_num_threads(1)
    uv = np.random.default_rng(0).random((count, 2)) * 60
    print(f"\n{'preset':28}{'map ns':>8}{'lookup ns':>11}")
    for name in PRESETS:
        fabric = load(name)
        cloth, yarn = compile_fabric(fabric), compile_yarn(fabric)
        sets, threads = np.empty(count, np.uint8), np.empty(count, np.int32)
        reals = [np.empty(count, np.float32) for _ in range(4)]
        best = [np.inf, np.inf]
        for turn in range(repeats + 1):
            start = time.perf_counter()
            found = laid(yarn, uv).uv
            middle = time.perf_counter()
            find_all(np.float32, cloth, found, sets, threads, *reals)
            end = time.perf_counter()
            if turn:
                best = [min(best[0], middle - start), min(best[1], end - middle)]
        print(f"{name:28}{best[0] / count * 1e9:8.1f}{best[1] / count * 1e9:11.1f}")


def main() -> None:
    """Parse the arguments and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--count", type=int, default=1_000_000)
    options = parser.parse_args()
    pictures(options.repeats)
    places(options.count, options.repeats)


if __name__ == "__main__":
    main()

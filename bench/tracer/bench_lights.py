"""The noise of each light's own part of a picture, in scenes of several lights.

    python bench/tracer/bench_lights.py [--preset polyester_satin_charmeuse ...] [--lights 3 16]

A drape-like sheet of cloth stands in a studio: a soft sky, a key light from the front and a rim
light from behind. Pixels belong to the light that brings more than half of their direct light.
Printed are, for each of these regions, the relative MSE of the whole picture at `--spp` samples
against a converged one, the ratio of rim to front, and the time a picture takes. With more lights
than three, lamps are added all around.
"""

from __future__ import annotations

import argparse
import statistics
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.fabric import Binding, Fabric
from fabricusd.reference.render import render_scene
from fabricusd.scene.light_kinds import DOME, RECT
from fabricusd.scene.scene import Camera, FabricSurface, Light, Mesh, Scene
from fabricusd.schema.anysource import load_any

SIZE = 96


def looking(eye: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4, 4) frame at `eye` whose -z points to `at`."""
    back = (eye - at) / np.linalg.norm(eye - at)
    right = np.cross((0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    frame = np.eye(4)
    frame[:3, 0], frame[:3, 1], frame[:3, 2] = right, np.cross(back, right), back
    frame[:3, 3] = eye
    return frame


def folds() -> Mesh:
    """A curtain a metre wide and high, in deep folds."""
    n = 160
    s, t = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, 3))
    points = np.stack([s - 0.5, t - 0.5, 0.06 * np.sin(9 * np.pi * s)], -1).reshape(-1, 3)
    i = np.arange(3 * (n + 1)).reshape(3, n + 1)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel(), i[1:, :-1].ravel()
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    uv = np.stack([1.6 * s, t], -1).reshape(-1, 2)[triangles]
    return Mesh(
        path="folds", points=points, triangles=triangles, uv=uv,
        material=np.zeros(len(triangles), int),
    )  # fmt: skip


def lamp(name: str, place: tuple[float, float, float], size: float, radiance: float) -> Light:
    """A square lamp that shines at the origin."""
    return Light(
        path=name, kind=RECT, radiance=(radiance,) * 3, width=size, height=size,
        frame=looking(np.array(place), np.zeros(3)),
    )  # fmt: skip


def lights(count: int) -> list[Light]:
    """The sky, the key and the rim light, and lamps around up to `count`."""
    found = [
        Light(path="sky", kind=DOME, radiance=(0.15,) * 3),
        lamp("key", (0.8, 0.8, 1.8), 0.4, 30.0),
        lamp("rim", (-1.4, 0.5, -0.9), 0.4, 60.0),
    ]
    for k in range(count - 3):
        angle = 2 * np.pi * k / max(count - 3, 1)
        found.append(lamp(f"lamp{k}", (2 * np.cos(angle), 1.0, 2 * np.sin(angle)), 0.2, 4.0))
    return found


def scene(fabric: Fabric, count: int) -> Scene:
    """The folds under `count` lights."""
    binding = Binding(fabric=fabric, threads_per_uv=(3000.0, 3000.0))
    eye = np.array([0.0, 0.1, 2.2])
    return Scene(
        meshes=[folds()], materials=[FabricSurface(binding=binding)], lights=lights(count),
        camera=Camera(frame=looking(eye, np.zeros(3)), focal_length=0.05),
    )  # fmt: skip


def picture(one: Scene, spp: int, seed: int, bounces: int) -> tuple[NDArray[np.float64], float]:
    """(h, w, 3) radiance, and the seconds of processor time that sampling took."""
    found = render_scene(
        one, width=SIZE, height=SIZE, spp=spp, seed=seed, level="far", max_bounces=bounces
    )
    return found.layers["beauty"][..., :3].astype(float), found.processor_seconds


def measure(fabric: Fabric, count: int, spp: int, many: int, repeat: int) -> str:
    """A row of the table."""
    whole = scene(fabric, count)
    parts = []
    for k in range(3):
        alone = replace(whole, lights=[whole.lights[k]])
        parts.append(picture(alone, 64, 1, 0)[0].sum(-1))
    share = np.array(parts) / np.maximum(sum(parts), 1e-9)
    truth = picture(whole, many, 99, 0)[0]
    seen = truth.sum(-1) > 1e-4
    errors: dict[str, list[float]] = {"sky": [], "front": [], "rim": [], "all": []}
    times = []
    for seed in range(repeat):
        found, seconds = picture(whole, spp, seed, 0)
        times.append(seconds)
        relative = ((found - truth) ** 2).sum(-1) / np.maximum((truth**2).sum(-1), 1e-8)
        for k, name in enumerate(("sky", "front", "rim")):
            region = (share[k] > 0.5) & seen
            errors[name].append(float(relative[region].mean()) if region.any() else np.nan)
        errors["all"].append(float(relative[seen].mean()))
    sky, front, rim, every = (statistics.median(errors[k]) for k in ("sky", "front", "rim", "all"))
    return (
        f"| {fabric.name} | {count} | {front:.2e} | {rim:.2e} | {sky:.2e} | {every:.2e} | "
        f"{rim / front:.2f} | {np.sqrt(rim / front):.2f} | {statistics.median(times):.2f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--preset", nargs="+", default=["polyester_satin_charmeuse", "linen_plain", "silk_shot"]
    )
    parser.add_argument("--lights", type=int, nargs="+", default=[3])
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--reference", type=int, default=2048)
    parser.add_argument("--repeat", type=int, default=5)
    given = parser.parse_args()
    print("| fabric | lights | front | rim | sky | all | rim / front | noise | processor s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in given.preset:
        fabric = load_any(name)[0]
        for count in given.lights:
            print(measure(fabric, count, given.spp, given.reference, given.repeat), flush=True)


if __name__ == "__main__":
    main()

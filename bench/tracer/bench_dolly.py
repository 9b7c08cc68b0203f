"""A dolly: whether a square of cloth keeps its brightness and its hue from near to far.

    python bench/tracer/bench_dolly.py [--presets NAME ...] [--elevations DEGREES ...]

The path tracer at its default settings (`--level auto`, shadows by `horizon`) looks straight down
on a flat square of even threads, of whole repeats, from 50 pixels a thread to 50 threads a pixel,
in the light of one sun without bounces. Each row gives the largest difference of the square's mean
from that at level `far`, in any channel, and at which distance; `noise` is the standard error of
the nearest picture's mean. Two azimuths of the sun.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.fabric import Binding, Fabric, even
from fabricusd.reference.render import render_scene
from fabricusd.scene.light_kinds import DISTANT
from fabricusd.scene.scene import Camera, FabricSurface, Light, Mesh, Scene
from fabricusd.schema import load

Floats = NDArray[np.float64]

PRESETS = ("polyester_satin_charmeuse", "silk_shot", "silk_crepe_de_chine", "linen_plain", "denim")
PIXELS_A_THREAD = (50.0, 25.0, 12.0, 6.0, 3.0, 1.5, 0.75, 0.3, 0.1, 0.02)
WIDEST = 640
"""Pixels along a picture, at most."""
AZIMUTHS = (33.0, 118.0)


def square(fabric: Fabric, per_thread: float, light: Light) -> tuple[Floats, Floats]:
    """((3,) mean, (3,) its standard error) of a picture of whole repeats."""
    repeat = np.array(true_repeat(fabric))
    pitch = np.array((fabric.warp.pitch, fabric.weft.pitch))
    pixel = pitch.max() / per_thread
    # As many repeats as give about 200 pixels, but whole ones.
    size = np.maximum(1, np.round(200 * pixel / (repeat * pitch))) * repeat * pitch
    width, height = (max(16, min(WIDEST, round(x / pixel))) for x in size)
    half = 0.75 * size
    corners = np.array([(x, 0.0, -y) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    points = corners * (half[0], 1.0, half[1])
    triangles = np.array([(0, 1, 2), (0, 2, 3)])
    plane = np.stack((points[:, 0], -points[:, 2]), axis=1)
    mesh = Mesh(
        path="cloth", points=points, triangles=triangles, uv=plane[triangles],
        material=np.zeros(2, np.int32),
    )  # fmt: skip
    frame = np.eye(4)
    frame[:3, :3] = np.array([(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)])
    frame[1, 3] = 1.0
    scene = Scene(
        meshes=[mesh], lights=[light],
        camera=Camera(frame=frame, orthographic=True, aperture=(size[0], size[1])),
        materials=[FabricSurface(binding=Binding(fabric=fabric, metres_per_uv=1.0))],
    )  # fmt: skip
    made = render_scene(scene, width=width, height=height, spp=64, max_bounces=0)
    pixels = np.asarray(made.layers["beauty"][..., :3], np.float64).reshape(-1, 3)
    return pixels.mean(axis=0), pixels.std(axis=0) / math.sqrt(len(pixels) * 8)


def sun(elevation: float, azimuth: float) -> Light:
    """A distant light above the square."""
    e, a = math.radians(elevation), math.radians(azimuth)
    back = np.array((math.cos(e) * math.cos(a), math.sin(e), -math.cos(e) * math.sin(a)))
    right = np.cross((0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    frame = np.eye(4)
    frame[:3, 0], frame[:3, 1], frame[:3, 2] = right, np.cross(back, right), back
    return Light(path="sun", kind=DISTANT, radiance=(3.0,) * 3, frame=frame)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presets", nargs="+", default=PRESETS)
    parser.add_argument("--elevations", nargs="+", type=float, default=(10.0, 39.0))
    options = parser.parse_args()
    print("| preset | law | sun | largest change | pixels a thread | noise |")
    print("|---|---|---|---|---|---|")
    for name in options.presets:
        fabric = even(load(name))
        for elevation in options.elevations:
            for azimuth in AZIMUTHS:
                light = sun(elevation, azimuth)
                found = [square(fabric, p, light) for p in PIXELS_A_THREAD]
                means = np.array([mean for mean, _ in found])
                change = np.abs(means / means[-1] - 1.0).max(axis=1)
                k = int(change.argmax())
                noise = float((found[0][1] / means[-1]).max())
                print(
                    f"| {name} | {fabric.surface_law} | {elevation:g}°, {azimuth:g}° | "
                    f"{change[k]:.3f} | {PIXELS_A_THREAD[k]:g} | {noise:.3f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()

"""Render the picture at the head of the README.

python docs/make_hero.py [--scale S] [--spp N] [--only NAME ...] [-o FILE]

docs/images/hero.png: a satin's threads, drawn out to the folds and to the skirt they belong to, and
skirts of denim and of tartan. The satin and the denim are presets; `TARTAN` is the command that
weaves the third.
"""

from __future__ import annotations

import argparse
import math
import shlex
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from fabricusd.cli.main import main as fabricusd
from fabricusd.fabric import Binding, Fabric
from fabricusd.files import whole_file
from fabricusd.images.files import write_png
from fabricusd.images.view import encode
from fabricusd.reference.render import render
from fabricusd.samples.garment import skirt_obj
from fabricusd.scene.files.mesh_file import read_mesh_file
from fabricusd.scene.light_kinds import DOME, RECT
from fabricusd.scene.scene import Camera, FabricSurface, Light, Mesh, PreviewSurface, Scene
from fabricusd.scene.studio import looking
from fabricusd.schema import load

HERE = Path(__file__).resolve().parent

SATIN, DENIM = "polyester_satin_charmeuse", "denim"
TARTAN = (
    'new --tartan "B20 K4 B4 K4 B4 K20 G20 K3 R3 K3 G20 K20 B20 R3" --palette '
    '"B=#2f3a66" "K=#2d2d2d" "G=#2f5f40" "R=#c0392d" --ends-per-cm 18 --picks-per-cm 18 '
    "--fibre wool -o tartan.usda"
)

UP = np.array([0.0, 1.0, 0.0])
GROUND = 0.30
"""Colour of the wall and the floor: a neutral grey."""

GUTTER = 8
"""White between two panels [pixels]."""


def lamp(
    name: str, eye: tuple[float, float, float], at: tuple[float, float, float],
    size: tuple[float, float], radiance: float, warmth: float = 0.0,
) -> Light:  # fmt: skip
    """A soft box of `size` [m] at `eye` that shines at `at`; `warmth` shifts blue to red."""
    return Light(
        path=name, kind=RECT, frame=looking(np.array(eye), np.array(at), UP),
        width=size[0], height=size[1],
        radiance=(radiance * (1 + warmth), radiance, radiance * (1 - warmth)),
    )  # fmt: skip


def camera(
    eye: tuple[float, float, float], at: tuple[float, float, float], wide: float,
    shape: tuple[int, int], f_stop: float = 0.0,
) -> Camera:  # fmt: skip
    """A camera that sees `wide` metres across at `at`, in a picture of `shape` (width, height)."""
    distance = math.dist(eye, at)
    across = 0.036
    return Camera(
        frame=looking(np.array(eye), np.array(at), UP),
        focal_length=across * distance / wide,
        aperture=(across, across * shape[1] / shape[0]),
        f_stop=f_stop,
        focus_distance=distance,
    )


def fold(fabric: Fabric, shape: tuple[int, int], wide: float = 0.0064) -> Scene:
    """Threads from near by, on the crest of a fold, with `wide` metres of cloth across."""
    side, count = 0.016, 161
    line = np.linspace(-side / 2, side / 2, count)
    x, y = np.meshgrid(line, line, indexing="ij")
    crest = 0.5 * x + 0.87 * y
    height = 0.0011 * np.cos(crest / 0.0030) + 0.0005 * np.cos((x - 0.4 * y) / 0.0041)
    points = np.stack([x, y, height], axis=-1).reshape(-1, 3)
    grid = np.arange(count * count).reshape(count, count)
    a, b, c, d = (g.ravel() for g in (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]))
    triangles = np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1)))
    turn = math.radians(-32)
    uv = np.stack(
        [math.cos(turn) * x - math.sin(turn) * y, math.sin(turn) * x + math.cos(turn) * y], axis=-1
    ).reshape(-1, 2)
    cloth = Mesh(
        path="cloth", points=points, triangles=triangles, uv=uv[triangles],
        material=np.zeros(len(triangles), np.int32),
    )  # fmt: skip
    return Scene(
        meshes=[cloth],
        materials=[FabricSurface(binding=Binding(fabric=fabric, metres_per_uv=1.0))],
        lights=[
            Light(path="sky", kind=DOME, radiance=(0.22, 0.23, 0.25)),
            lamp("key", (-0.06, 0.07, 0.10), (0, 0, 0), (0.05, 0.05), 9.0, 0.04),
            lamp("rim", (0.10, 0.05, 0.03), (0, 0, 0), (0.03, 0.06), 9.0, -0.04),
        ],
        camera=camera((0.004, -0.030, 0.052), (0, 0.0004, 0.001), wide, shape, 200.0),
    )


def skirt(
    fabric: Fabric, shape: tuple[int, int], *, eye: tuple[float, float, float],
    at: tuple[float, float, float], wide: float, bias: float = 0.0,
) -> Scene:  # fmt: skip
    """The sample skirt as it hangs, before a seamless wall."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "skirt.obj"
        path.write_text(skirt_obj(), encoding="ascii")
        laid = Binding(fabric=fabric, metres_per_uv=1.0, rotation=bias)
        scene = read_mesh_file(path, laid, "cm")
    wall = len(scene.materials)
    scene.materials.append(PreviewSurface(name="wall", diffuse=(GROUND,) * 3, roughness=1, ior=1))
    points = np.array([(-9, -9, -1.6), (9, -9, -1.6), (9, 9, -1.6), (-9, 9, -1.6)], float)
    scene.meshes.append(
        Mesh(path="wall", points=points, triangles=np.array([(0, 1, 2), (0, 2, 3)]),
             material=np.full(2, wall, np.int32))
    )  # fmt: skip
    middle = (0.0, 0.75, 0.0)
    scene.lights = [
        Light(path="sky", kind=DOME, radiance=(0.22, 0.225, 0.23), hidden=True),
        lamp("key", (-1.5, 1.9, 1.7), middle, (0.4, 1.2), 56.0, 0.05),
        lamp("fill", (1.9, 0.8, 1.2), middle, (0.25, 1.6), 17.0, -0.03),
        lamp("rim", (1.3, 1.6, -1.2), middle, (0.5, 1.2), 24.0, -0.04),
        lamp("wall", (-0.6, 2.6, -0.4), (0.2, 0.6, -1.6), (1.2, 0.4), 6.0),
    ]
    scene.camera = camera(eye, at, wide, shape)
    return scene


def tartan() -> Fabric:
    """The cloth of `TARTAN`."""
    with tempfile.TemporaryDirectory() as folder:
        words = shlex.split(TARTAN)
        words[-1] = str(Path(folder) / words[-1])
        if fabricusd(words):
            sys.exit(1)
        return load(words[-1])


WHOLE = {"eye": (0.45, 0.80, 4.2), "at": (0.0, 0.665, 0.0), "wide": 0.66, "bias": math.pi / 4}
MIDDLE = {"eye": (0.35, 0.75, 2.2), "at": (0.02, 0.60, 0.1), "wide": 0.34}
NEAR = {"eye": (0.35, 0.85, 1.4), "at": (0.03, 0.62, 0.2), "wide": 0.06}

STOPS = {"threads": 0.2, "satin": 0.0, "denim": 0.2, "tartan": 0.7}
"""Exposure of each panel [stops]: dark cloth is exposed longer."""

PANELS: dict[str, tuple[tuple[int, int], Callable[[tuple[int, int]], Scene]]] = {
    "threads": ((880, 990), lambda shape: fold(load(SATIN), shape)),
    "satin": ((872, 560), lambda shape: skirt(load(SATIN), shape, **WHOLE)),
    "denim": ((432, 422), lambda shape: skirt(load(DENIM), shape, **NEAR)),
    "tartan": ((432, 422), lambda shape: skirt(tartan(), shape, **MIDDLE)),
}
"""Sizes [pixels] and scenes of the panels, see `composed`."""


def panel(name: str, scale: float, spp: int) -> np.ndarray:
    """(h, w, 3) uint8 of a panel."""
    shape, scene = PANELS[name]
    width, height = (round(scale * side) for side in shape)
    made = render(scene((width, height)), width=width, height=height, spp=spp, denoise=True)
    print(f"{name}: {made.seconds:.0f} s, {made.processor_seconds:.0f} s of processors", flush=True)
    return encode(made.layers["denoised"][..., :3], STOPS[name])


def composed(panels: dict[str, np.ndarray]) -> np.ndarray:
    """The threads on the left; on the right the satin, above the denim and the tartan."""
    pictures = {
        name: Image.fromarray(made).resize(PANELS[name][0], Image.Resampling.LANCZOS)
        for name, made in panels.items()
    }
    right = pictures["threads"].width + GUTTER
    below = pictures["satin"].height + GUTTER
    size = (right + pictures["satin"].width, pictures["threads"].height)
    whole = Image.new("RGB", size, "white")
    whole.paste(pictures["threads"], (0, 0))
    whole.paste(pictures["satin"], (right, 0))
    whole.paste(pictures["denim"], (right, below))
    whole.paste(pictures["tartan"], (size[0] - pictures["tartan"].width, below))
    return np.asarray(whole)


def save_small(picture: np.ndarray, path: Path) -> None:
    """Write a PNG of 256 colours, dithered: a third of the size, and alike to the eye."""
    whole = Image.fromarray(picture)
    palette = whole.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=2)
    small = whole.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG)
    with whole_file(str(path)) as temporary:
        small.save(temporary, "PNG", optimize=True)


def main() -> None:
    """Render the panels, or those that are named, and put them together."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--only", nargs="+", choices=list(PANELS), default=[])
    parser.add_argument("-o", "--output", type=Path, default=HERE / "images" / "hero.png")
    options = parser.parse_args()
    made = {name: panel(name, options.scale, options.spp) for name in options.only or PANELS}
    if options.only:
        for name, picture in made.items():
            write_png(options.output.with_name(f"{options.output.stem}_{name}.png"), picture)
        return
    save_small(composed(made), options.output)


if __name__ == "__main__":
    main()

"""Render the derived presets for docs/presets.md, and write that page's table.

python docs/make_presets.py [NAME ...] [--spp N]

docs/images/presets.png shows a tablecloth of each, and 60 and 12 mm of its face and of its back,
over a card of stripes that shows where cloth is open. With names, only those are rendered, into
docs/images/presets_try.png, and the page is left alone.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("agg")

from matplotlib import pyplot

from fabricusd.appearance.weave.lookup import back_of
from fabricusd.fabric import Binding, Fabric
from fabricusd.files import whole_file
from fabricusd.images.view import encode
from fabricusd.presets.rows import ROWS, Row
from fabricusd.reference.denoise import has_denoiser
from fabricusd.reference.render import render
from fabricusd.scene.light_kinds import DISTANT, DOME
from fabricusd.scene.scene import (
    Camera,
    FabricSurface,
    Light,
    Mesh,
    PreviewSurface,
    Scene,
)
from fabricusd.scene.usd.stage import read_usd_scene
from fabricusd.schema import load

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "samples"))

TALL, SMALL = 330, 165
"""Pixels: a side of the drape, and of each of the three squares beside it."""

FAR, NEAR = 0.06, 0.012
"""Side of the squares [m]."""

COLUMNS = 3

CLOSER = 1.7
"""How much larger the drape is than in its sample."""


def drape() -> Scene:
    """A tablecloth that hangs over a drum, in a studio."""
    from make_samples import make_drape

    with tempfile.TemporaryDirectory() as folder:
        scene = read_usd_scene(make_drape(Path(folder)))
    assert scene.camera is not None
    near = replace(scene.camera, focal_length=CLOSER * scene.camera.focal_length)
    return replace(scene, camera=near)


def dressed(scene: Scene, fabric: Fabric) -> Scene:
    """The scene with its cloth of `fabric`."""
    materials = [
        replace(m, binding=replace(m.binding, fabric=fabric)) if isinstance(m, FabricSurface) else m
        for m in scene.materials
    ]
    return replace(scene, materials=materials)


def square(fabric: Fabric, side: float, *, stripes: float) -> Scene:
    """A flat square from above, under a key light and a sky, a millimetre above a striped card.

    stripes : width of a stripe [m]
    """
    h = 0.5 * side
    corners = np.array([(-h, h), (h, h), (h, -h), (-h, -h)])
    triangles = np.array([(0, 1, 2), (0, 2, 3)])
    plane = np.stack((corners[:, 0], -corners[:, 1]), axis=1)

    def at(x: np.ndarray, height: float) -> np.ndarray:
        return np.stack((x[:, 0], np.full(len(x), height), x[:, 1]), axis=1)

    meshes = [
        Mesh(path="cloth", points=at(corners, 0.0), triangles=triangles, uv=plane[triangles],
             material=np.zeros(2, np.int32))
    ]  # fmt: skip
    for k in range(-4, 4):
        bar = np.array([(k * stripes, 2 * h), ((k + 1) * stripes, 2 * h),
                        ((k + 1) * stripes, -2 * h), (k * stripes, -2 * h)])  # fmt: skip
        meshes.append(
            Mesh(path=f"stripe{k}", points=at(bar, -0.001), triangles=triangles,
                 material=np.full(2, 1 + k % 2, np.int32))
        )  # fmt: skip
    frame = np.eye(4)
    frame[:3, :3] = np.array([(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)])
    frame[1, 3] = 1.0
    key = np.eye(4)
    key[:3, :3] = np.array([(0.8, 0.0, 0.6), (-0.36, 0.8, 0.48), (-0.48, -0.6, 0.64)]).T
    return Scene(
        meshes=meshes,
        materials=[
            FabricSurface(binding=Binding(fabric=fabric, metres_per_uv=1.0)),
            PreviewSurface(diffuse=(0.03, 0.03, 0.03), roughness=1.0, ior=1.0),
            PreviewSurface(diffuse=(0.6, 0.6, 0.6), roughness=1.0, ior=1.0),
        ],
        lights=[
            Light(path="sun", kind=DISTANT, radiance=(5.0,) * 3, frame=key),
            Light(path="sky", kind=DOME, radiance=(0.8,) * 3),
        ],
        camera=Camera(frame=frame, orthographic=True, aperture=(side, side)),
    )


def picture(scene: Scene, size: int, spp: int, *, denoise: bool = False) -> np.ndarray:
    """(size, size, 3) of a scene, for a screen."""
    made = render(scene, width=size, height=size, spp=spp, denoise=denoise)
    return encode(made.layers["denoised" if denoise else "beauty"][..., :3], 0.0)


def tile(studio: Scene, fabric: Fabric, spp: int) -> np.ndarray:
    """The drape; beside it 60 mm above 12 mm, of the face and of the back."""

    def seen(cloth: Fabric, side: float) -> np.ndarray:
        found = picture(square(cloth, side, stripes=side / 5), SMALL, spp)
        found[-2:] = found[:, :2] = 255
        return found

    hung = picture(dressed(studio, fabric), TALL, max(spp // 3, 1), denoise=has_denoiser())
    sides = [
        np.concatenate([seen(cloth, side) for side in (FAR, NEAR)])
        for cloth in (fabric, back_of(fabric))
    ]
    return np.concatenate((hung, *sides), axis=1)


def sheet(rows: list[Row], target: Path, spp: int) -> None:
    """Write the contact sheet of `rows`."""
    studio = drape()
    lines = -(-len(rows) // COLUMNS)
    wide, high = 2 * TALL + 10, TALL + 28
    figure = pyplot.figure(figsize=(COLUMNS * wide / 100, lines * high / 100), dpi=100)
    for k, row in enumerate(rows):
        line, column = divmod(k, COLUMNS)
        place = (
            column / COLUMNS,
            1 - (line + 1) / lines,
            2 * TALL / wide / COLUMNS,
            TALL / high / lines,
        )
        axes = figure.add_axes(place)
        axes.imshow(tile(studio, load(row.name), spp), interpolation="none")
        axes.set_axis_off()
        axes.set_title(row.name, fontsize=12, loc="left", pad=5)
        print(row.name, flush=True)
    with whole_file(str(target)) as temporary:
        figure.savefig(temporary, format="png")


def main() -> None:
    """Make the sheet, and the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="presets (default: all)")
    parser.add_argument("--spp", type=int, default=48)
    options = parser.parse_args()
    rows = [row for row in ROWS if not options.names or row.name in options.names]
    name = "presets_try.png" if options.names else "presets.png"
    sheet(rows, HERE / "images" / name, options.spp)


if __name__ == "__main__":
    main()

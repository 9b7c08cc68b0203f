"""Make the fabrics of the README by its own commands, and render them for its picture.

python docs/make_fabrics.py [--spp N]

docs/images/fabrics.png shows 12 mm of each, 80 mm, and 80 mm of its back.
"""

from __future__ import annotations

import argparse
import shlex
import sys
import tempfile
from pathlib import Path

import numpy as np

from fabricusd.appearance.weave.lookup import back_of
from fabricusd.cli.main import main as fabricusd
from fabricusd.fabric import Binding, Fabric
from fabricusd.images.files import write_png
from fabricusd.images.view import encode
from fabricusd.reference.render import render_scene
from fabricusd.scene.light_kinds import DISTANT, DOME
from fabricusd.scene.scene import Camera, FabricSurface, Light, Mesh, Scene
from fabricusd.schema import load

HERE = Path(__file__).resolve().parent

COMMANDS = {
    "denim": 'new --weave "twill 3/1" --warp-yarn "Ne 7" --weft-yarn "Ne 8" --ends-per-inch 68 '
    '--picks-per-inch 44 --weight 14oz --warp-color "#2c3858" --weft-color "#e0dccf" -o denim.usda',
    "tartan": 'new --tartan "B24 W4 B24 R2 K24" --ends-per-cm 22 --picks-per-cm 22 --fibre wool '
    "-o tartan.usda",
    "damask": "new --figure rose.png --ends-per-cm 60 --picks-per-cm 60 --fibre silk "
    "-o damask.usda",
    "poplin": "new --weave plain --ends-per-cm 50 --picks-per-cm 28 --warp-color white "
    "--weft-color white -o poplin.usda",
}
"""The README's commands."""

SIZE = 240
NEAR, FAR = 0.012, 0.08
"""Side of the squares seen from near by and from farther away [m]."""


def rose(path: Path, size: int = 240) -> None:
    """Artwork: a rose of five petals on a ground."""
    y, x = np.mgrid[0:size, 0:size] - size / 2
    r, turn = np.hypot(x, y), np.arctan2(y, x)
    inside = (r < size * (0.28 + 0.12 * np.cos(5 * turn))) & (r > 0.06 * size)
    corner = np.hypot((x + size / 2) % size - size / 2, (y + size / 2) % size - size / 2)
    ink = inside | (corner < 0.08 * size)
    gold, red = np.uint8((214, 178, 96)), np.uint8((140, 36, 48))
    write_png(path, np.where(ink[..., None], gold, red))


def square(fabric: Fabric, side: float, spp: int) -> np.ndarray:
    """A flat square of cloth from above, under a key light and a sky."""
    h = 0.5 * side
    points = np.array([(-h, 0, h), (h, 0, h), (h, 0, -h), (-h, 0, -h)])
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
            Light(path="sun", kind=DISTANT, radiance=(2.6,) * 3, frame=key),
            Light(path="sky", kind=DOME, radiance=(0.4,) * 3),
        ],
        camera=Camera(frame=frame, orthographic=True, aperture=(side, side)),
    )  # fmt: skip
    made = render_scene(scene, width=SIZE, height=SIZE, spp=spp)
    return encode(made.layers["beauty"][..., :3], 0.0)


def main() -> None:
    """Make the sheet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--spp", type=int, default=64)
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rose(folder / "rose.png")
        for fabric, command in COMMANDS.items():
            words = shlex.split(command.replace("rose.png", str(folder / "rose.png")))
            words[-1] = str(folder / words[-1])
            if fabricusd(words):
                sys.exit(1)
            cloth = load(folder / f"{fabric}.usda")
            rows.append(
                np.concatenate(
                    [
                        square(cloth, NEAR, options.spp),
                        square(cloth, FAR, options.spp),
                        square(back_of(cloth), FAR, options.spp),
                    ]
                )
            )
            print(fabric, flush=True)
    write_png(HERE / "images" / "fabrics.png", np.concatenate(rows, axis=1))


if __name__ == "__main__":
    main()

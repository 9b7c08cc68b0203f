"""Render every preset from near by, as a swatch and as a drape, and write docs/gallery.md.

python docs/make_gallery.py [NAME ...] [--spp N] [--page]

Each preset gets a strip docs/images/gallery/NAME.jpg. With names, only those are rendered; with
`--page`, only the page is written.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from make_hero import camera, fold, lamp
from make_presets import drape, dressed
from PIL import Image

from fabricusd.fabric import Binding, Fabric
from fabricusd.files import whole_file
from fabricusd.images.view import encode
from fabricusd.reference.render import render
from fabricusd.scene.light_kinds import DOME
from fabricusd.scene.scene import FabricSurface, Light, Mesh, PreviewSurface, Scene
from fabricusd.schema import load, preset_names, published_names

HERE = Path(__file__).resolve().parent
PICTURES = HERE / "images" / "gallery"

SIDE, GUTTER = 320, 6
"""Of each of the three pictures of a strip, and of the white between them [pixels]."""

CLOSE = 0.006
"""Width of cloth across the close-up [m]."""

SWATCH = 0.05
"""Side of the swatch [m]."""

ROLL = 0.0025
"""Radius to which the swatch's corner is folded back [m]."""

QUALITY = 88
"""Of the JPEG files."""


def grid(points: np.ndarray, uv: np.ndarray, path: str, material: int) -> Mesh:
    """A mesh of (m, n, 3) points and their (m, n, 2) UVs."""
    m, n = points.shape[:2]
    index = np.arange(m * n).reshape(m, n)
    a, b, c, d = (
        i.ravel() for i in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    )
    triangles = np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1)))
    return Mesh(
        path=path,
        points=points.reshape(-1, 3),
        triangles=triangles,
        uv=uv.reshape(-1, 2)[triangles],
        material=np.full(len(triangles), material, np.int32),
    )


def folded(count: int = 201) -> tuple[np.ndarray, np.ndarray]:
    """((m, m, 3), (m, m, 2)) points and UVs [m] of a swatch with one corner folded back.

    Beyond a diagonal line the cloth runs half round a roll, and lies on its back after that.
    """
    line = np.linspace(-SWATCH / 2, SWATCH / 2, count)
    x, y = np.meshgrid(line, line, indexing="ij")
    diagonal = np.array([1.0, 1.0]) / math.sqrt(2)
    along = x * diagonal[0] + y * diagonal[1]
    start = 0.19 * SWATCH
    beyond = np.maximum(along - start, 0.0)
    turn = np.minimum(beyond / ROLL, math.pi)
    after = np.maximum(beyond - math.pi * ROLL, 0.0)
    moved = np.where(beyond > 0, start + ROLL * np.sin(turn) - after, along) - along
    # The flap does not lie quite flat: it opens towards its tip.
    height = 0.0004 + ROLL * (1 - np.cos(turn)) + 0.12 * after
    height = height + 0.0006 * (1 + np.cos(9 * x / SWATCH + 5 * y / SWATCH)) * np.clip(
        (start - along) / 0.008, 0, 1
    )
    points = np.stack([x + moved * diagonal[0], y + moved * diagonal[1], height], axis=-1)
    return points, np.stack([x, y], axis=-1)


def swatch(fabric: Fabric) -> Scene:
    """A swatch on a card that is ruled in centimetres."""
    card = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
    two = np.array([(0, 1, 2), (0, 2, 3)])

    def sheet(low: tuple[float, float], high: tuple[float, float], z: float, what: int) -> Mesh:
        middle, half = np.add(low, high) / 2, np.subtract(high, low) / 2
        flat = np.concatenate((middle + half * card, np.full((4, 1), z)), axis=1)
        return Mesh(path=f"card {low}", points=flat, triangles=two,
                    material=np.full(2, what, np.int32))  # fmt: skip

    meshes = [grid(*folded(), "swatch", 0), sheet((-0.3, -0.3), (0.3, 0.3), -0.0005, 1)]
    for k in range(-5, 6):
        at, thin = 0.01 * k, 0.00015
        meshes += [
            sheet((at - thin, -0.05), (at + thin, 0.05), -0.0004, 2),
            sheet((-0.05, at - thin), (0.05, at + thin), -0.0004, 2),
        ]
    return Scene(
        meshes=meshes,
        materials=[
            FabricSurface(binding=Binding(fabric=fabric, metres_per_uv=1.0)),
            PreviewSurface(diffuse=(0.42,) * 3, roughness=1.0, ior=1.0),
            PreviewSurface(diffuse=(0.10,) * 3, roughness=1.0, ior=1.0),
        ],
        lights=[
            Light(path="sky", kind=DOME, radiance=(0.36, 0.36, 0.36)),
            lamp("key", (-0.30, 0.25, 0.40), (0, 0, 0), (0.16, 0.16), 29.0),
            lamp("rim", (0.35, 0.30, 0.20), (0, 0, 0), (0.10, 0.25), 10.0),
        ],
        camera=camera((0.0, -0.13, 0.33), (0.0, 0.0, 0.002), 1.28 * SWATCH, (1, 1)),
    )


@cache
def table() -> Scene:
    """The drape of docs/make_presets.py, on a neutral ground and in white light."""
    scene = drape()
    lights = [
        replace(light, radiance=(0.85 * sum(light.radiance) / 3,) * 3) for light in scene.lights
    ]
    materials = [
        replace(m, diffuse=(0.32,) * 3) if isinstance(m, PreviewSurface) else m
        for m in scene.materials
    ]
    return replace(scene, materials=materials, lights=lights)


def strip(fabric: Fabric, spp: int) -> Image.Image:
    """The three pictures of a preset beside one another."""
    scenes = (fold(fabric, (SIDE, SIDE), CLOSE), swatch(fabric), dressed(table(), fabric))
    whole = Image.new("RGB", (3 * SIDE + 2 * GUTTER, SIDE), "white")
    for k, scene in enumerate(scenes):
        made = render(scene, width=SIDE, height=SIDE, spp=spp, denoise=True)
        shown = encode(made.layers["denoised"][..., :3])
        whole.paste(Image.fromarray(shown), (k * (SIDE + GUTTER), 0))
    return whole


HEAD = """# Gallery

Every preset from near by (6 mm of cloth across), as a swatch of 50 mm with a corner folded back on
a card ruled in centimetres, and as a tablecloth. `python docs/make_gallery.py` renders these
pictures with the path tracer and Open Image Denoise.

Each command below writes the fabric to a file. To see it at once, on a cylinder:

    fabricusd preview denim -o denim.png

"""

TITLES = {
    "## Published fabrics\n\n": "The numbers of these rest on measured fabrics; "
    "[schema.md](schema.md) says which.\n\n",
    "## Threads\n\n": "Each is a plain weave of one published thread, to look at the thread.\n\n",
    "## Cloth of the trade\n\n": "These are derived from yarn counts and densities of the trade; "
    "[presets.md](presets.md) has the sources.\n\n",
}


def page() -> str:
    """The text of docs/gallery.md."""
    published = published_names()
    threads = [name for name in published if name.startswith("thread_")]
    groups = (
        [name for name in published if name not in threads],
        threads,
        [name for name in preset_names() if name not in published],
    )
    text = HEAD
    for (title, words), names in zip(TITLES.items(), groups, strict=True):
        text += title + words
        for name in names:
            text += f"### {name}\n\n![{name}](images/gallery/{name}.jpg)\n\n"
            text += f"    fabricusd new --preset {name} -o {name}.usda\n\n"
    return text.rstrip() + "\n"


def main() -> None:
    """Render the strips, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="presets (default: all)")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--page", action="store_true", help="write the page alone")
    options = parser.parse_args()
    (HERE / "gallery.md").write_text(page(), encoding="utf-8")
    if options.page:
        return
    PICTURES.mkdir(parents=True, exist_ok=True)
    start, worked = time.perf_counter(), time.process_time()
    for name in options.names or preset_names():
        made = strip(load(name), options.spp)
        with whole_file(str(PICTURES / f"{name}.jpg")) as temporary:
            made.save(temporary, "JPEG", quality=QUALITY, optimize=True, subsampling=0)
        seconds = time.perf_counter() - start
        print(f"{name}: {seconds:.0f} s, {time.process_time() - worked:.0f} s of processors so far",
              flush=True)  # fmt: skip


if __name__ == "__main__":
    main()

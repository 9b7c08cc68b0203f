"""Render the derived presets for docs/presets.md, and write that page's table.

python docs/make_presets.py [NAME ...] [--spp N]

docs/images/presets.png shows a tablecloth of each, and 60 and 12 mm of its face and of its back,
over a card of stripes that shows where cloth is open. With names, only those are rendered, into
docs/images/presets_try.png, and the page is left alone.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image

matplotlib.use("agg")

from matplotlib import pyplot

from fabricusd.appearance.weave.coverage import coverage
from fabricusd.appearance.weave.lookup import back_of
from fabricusd.dye import cloth_color
from fabricusd.dye.difference import code
from fabricusd.fabric import Binding, Fabric
from fabricusd.files import whole_file
from fabricusd.images.view import encode
from fabricusd.presets.rows import ROWS, Row
from fabricusd.presets.spinning import SPINNING
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
from fabricusd.weaves.cloth import GRAM, weight

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "samples"))

TALL, SMALL = 330, 165
"""Pixels: a side of the drape, and of each of the three squares beside it."""

FAR, NEAR = 0.06, 0.012
"""Side of the squares [m]."""

COLUMNS = 3

SHRUNK = 2 / 3
"""Size of the sheet over what is rendered: its noise takes less of the file."""

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
        whole = Image.open(temporary).convert("RGB")
        small = whole.resize(
            [round(side * SHRUNK) for side in whole.size], Image.Resampling.LANCZOS
        )
        small.save(temporary, "PNG", optimize=True)


HEAD = """# Cloth of the trade

Made by `python docs/make_presets.py`.

These presets are *derived*, not published: cloth that people look for, woven from yarn counts and
densities of the trade by the functions that `fabricusd new` is made of, under the `conserving` law.

    fabricusd new --preset denim -o denim.usda
    fabricusd set denim.usda warp.colour="#1f2a4d" weight=14oz

![The derived presets](images/presets.png)

Each as a tablecloth; then 60 mm (above) and 12 mm (below) of its face, and the same of its back.
The squares lie a millimetre above a card of dark and light stripes, which show where light comes
through.

| preset | what | weave | warp | weft | g/m² | in the trade | colour | gap | sources |
|---|---|---|---|---|---:|---:|---|---:|---|
"""

MIDDLE = """
The weight is computed from counts, densities and the crimp of the curves ([yarns.md](yarns.md)).
The colour is that of the cloth, folded until opaque ([color.md](color.md)). The layer's `doc` says
which numbers have a source and which are assumed. The range of weights in the trade has a source
for canvas, denim, gabardine and organza, and is assumed for the others. Sources are keys of
[references.bib](references.bib).

## Yarns
A yarn is as thick as Peirce's ([yarns.md](yarns.md)), of fibres that fill the share *packing* of
it. In cloth it is pressed flat: *flatness* is its width over its height, and its section keeps its
area. A set covers what threads of that width cover, written as `fabric:warp:coverage` and
`fabric:weft:coverage`. Packing and flatness are assumed. CVm and the variation of the count are
those that are usual for the kind of yarn [UsterStatistics].

| yarn | CVm | count varies by | slubs | packing | flatness | of |
|---|---:|---:|---|---:|---:|---|
"""

TAIL = """
Threads scatter as those that `fabricusd new --fibre` makes ([color.md](color.md)): no fit of
cotton or nylon is published. Their curves are those of `new`, which rise and fall by 20°, but for
the warp of sateen, whose floats are flat in the middle, and for ripstop, whose ground is flat and
whose cords stand up. `fabric:sides:*` are measured on the tubes of each cloth
([model.md](model.md), section 7).

## Knits
Jersey, interlock, rib, tricot and fleece are knitted, not woven. Where one is asked for by name,
as in `--preset jersey`, an error says so, and names the woven preset that is nearest.

## Published and derived
`fabricusd.schema.preset_names()` names all presets, `published_names()` those that rest on the
fabrics of [Bisker2011] and [Sadeghi2013], without the ones of this page. Tables that were measured
for each preset, such as those behind `render --max-error`, have the published ones alone; any other
cloth, those of this page included, gets the settings that the hardest of them needs.

## To add one
Add a row to `fabricusd/presets/rows.py`, run `python -m fabricusd.presets --only NAME`, and look at
what `python docs/make_presets.py NAME` renders. A test holds each layer to its row.
"""


def line(row: Row) -> str:
    """A preset's line of the table."""
    fabric = load(row.name)
    found = weight(fabric)
    assert found is not None
    low, high = row.trade
    keys = ", ".join(re.findall(r"\[\w+\]", row.source)) or "assumed"
    return (
        f"| `{row.name}` | {row.is_named} | {row.weave} | {row.warp} | {row.weft} | "
        f"{found.total / GRAM:.0f} | {low:g} to {high:g} | `{code(cloth_color(fabric))}` | "
        f"{100 * float(coverage(fabric).gap):.1f} % | {keys} |\n"
    )


def yarn_line(name: str) -> str:
    """The line of a kind of yarn."""
    kind = SPINNING[name]
    amount, length, spacing = kind.slub
    slubs = f"{100 * amount:g} % wider, {length * 1e3:g} mm long, {spacing * 1e3:g} mm apart"
    of = [row.name for row in ROWS if name in (row.warp.spun, row.weft.spun)]
    return (
        f"| {kind.words} | {100 * kind.cv:g} % | {100 * kind.count:g} % | "
        f"{slubs if amount else 'none'} | {kind.packing:g} | {kind.flatness:g} | "
        f"{', '.join(of)} |\n"
    )


def page() -> str:
    """The text of docs/presets.md."""
    return "".join((HEAD, *map(line, ROWS), MIDDLE, *map(yarn_line, SPINNING), TAIL))


def main() -> None:
    """Make the sheet, and the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="presets (default: all)")
    parser.add_argument("--spp", type=int, default=48)
    parser.add_argument("--page", action="store_true", help="write the page alone")
    options = parser.parse_args()
    rows = [row for row in ROWS if not options.names or row.name in options.names]
    name = "presets_try.png" if options.names else "presets.png"
    if not options.names:
        (HERE / "presets.md").write_text(page(), encoding="utf-8")
    if not options.page:
        sheet(rows, HERE / "images" / name, options.spp)


if __name__ == "__main__":
    main()

"""Compare Cycles with the reference path tracer, for each preset and kind of material.

    python bench/materials/blender_compare.py --blender PYTHON [--out FOLDER] [--presets NAME ...]

`PYTHON` is an interpreter that can `import bpy`; `make blender` makes one. The subjects are half a
cylinder wrapped in the fabric, and a draped cloth. They are rendered by fabricusd at level far and,
from the baked look, by Cycles in four ways: as UsdPreviewSurface, which is what Blender imports; by
our add-on as the fitted Principled BSDF, and as lobes; and with the OSL shader. The script prints a
table of delta E 2000 and writes the pictures side by side.

With `--light sun`, the default, the light is one distant light, without bounces. With `--light
sky`, it is a clear sky with a hazy sun in it, with four bounces, and means of 2 x 2 pixels are
compared; OSL cannot show it.

With `--picture FILE`, nothing is rendered: the parts that FOLDER has of that light are put below
one another, a row for each subject and preset and a column for the reference and each kind.

With `--behind`, the fabrics' threads conserve energy and the sun stands behind the cloth, which
shows what comes through. There are no lobes and no OSL shader of such threads.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdLux

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "samples"))
sys.path.insert(0, str(HERE))

from make_samples import Grid, camera, define_grid, dress, look_at, make_drape  # noqa: E402

from fabricusd.bake.bake import bake  # noqa: E402
from fabricusd.bake.job import Settings as BakeSettings  # noqa: E402
from fabricusd.images.files import read_exr_layers, write_exr, write_png  # noqa: E402
from fabricusd.materials.lobes.skies import SKIES  # noqa: E402
from fabricusd.materials.materials import write_materials  # noqa: E402
from fabricusd.materials.recipes import Settings  # noqa: E402
from fabricusd.materials.targets.blender.pack import write_addon  # noqa: E402
from fabricusd.materials.targets.osl import write_osl  # noqa: E402
from fabricusd.quality.pictures import difference  # noqa: E402
from fabricusd.reference.render import render  # noqa: E402
from fabricusd.scene.staging import Staging  # noqa: E402
from fabricusd.schema import load  # noqa: E402
from fabricusd.srgb import srgb_encode  # noqa: E402

PRESETS = (
    "linen_plain",
    "silk_crepe_de_chine",
    "polyester_satin_charmeuse",
    "silk_shot",
    "velvet",
    "wool_flannel",
)
TOWARDS = np.array([0.45, 0.5, 0.74]) / np.linalg.norm([0.45, 0.5, 0.74])
BEHIND = TOWARDS * (1.0, 1.0, -1.0)
IRRADIANCE = math.pi
SIZE = (300, 200)
BOUNCES = 4
"""Under the sky."""

KINDS = {
    "sun": ("preview", "principled", "lobes", "osl"),
    "sky": ("preview", "principled", "lobes"),
    "behind": ("preview", "principled"),
}
"""Kinds of material by kind of light."""


class Subject:
    """A mesh, and the camera that sees it."""

    def __init__(self, name, eye, at, focal_length):
        self.name, self.eye, self.at, self.focal_length = name, eye, at, focal_length


CYLINDER = Subject("cylinder", (0.0, 0.14, 1.0), (0.0, 0.14, 0.0), 90.0)
GARMENT = Subject("garment", (0.55, 0.95, 1.75), (0.0, 0.24, 0.0), 60.0)


def cloth_of(preset, behind):
    fabric = load(preset)
    return replace(fabric, model="conserving", back=None) if behind else fabric


def make_scene(subject, preset, folder, light):
    """The scene that fabricusd renders; its mesh is the one that is baked."""
    path = folder / f"{subject.name}.{preset}.{light}.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    mesh = cylinder(stage) if subject is CYLINDER else drape(stage, folder)
    dress(stage, mesh, cloth_of(preset, light == "behind"))
    if light == "sky":
        sky(stage, folder)
    else:
        sun = UsdLux.DistantLight.Define(stage, "/World/Light")
        sun.CreateIntensityAttr(IRRADIANCE)
        sun.CreateAngleAttr(0.0)
        towards = BEHIND if light == "behind" else TOWARDS
        sun.AddTransformOp().Set(look_at(tuple(towards.tolist()), (0.0, 0.0, 0.0)))
    camera(stage, subject.eye, subject.at, subject.focal_length)
    stage.GetRootLayer().Save()
    return path


def sky(stage, folder):
    """A dome with the picture of the sky "clear", and a dark ground."""
    h, w = 256, 512
    v, u = np.meshgrid((np.arange(h) + 0.5) / h, (np.arange(w) + 0.5) / w, indexing="ij")
    sine, cosine = np.sin(np.pi * v), np.cos(np.pi * v)
    a = 2.0 * math.pi * u - 0.5 * math.pi
    # The sun stands before the subjects, on the camera's right.
    towards = np.stack((sine * np.sin(a), sine * np.cos(a), np.maximum(cosine, 0.0)), axis=-1)
    radiance = SKIES["clear"](towards.reshape(-1, 3)).reshape(h, w)
    radiance = np.where(cosine > 0.0, radiance, 0.3)
    solid = sine * math.pi / h * 2.0 * math.pi / w
    radiance *= math.pi / (radiance * solid * np.maximum(cosine, 0.0)).sum()
    path = folder / "sky.exr"
    pixels = np.repeat(radiance[..., None], 3, axis=2) * (0.9, 1.0, 1.15)
    alpha = np.ones((h, w, 1))
    layers = {"beauty": np.concatenate((pixels, alpha), axis=2).astype(np.float32)}
    write_exr(path, layers, {"beauty": tuple("RGBA")}, {})
    dome = UsdLux.DomeLight.Define(stage, "/World/Sky")
    dome.CreateTextureFileAttr(f"./{path.name}")


def cylinder(stage):
    phi, y = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 257), np.linspace(0, 0.28, 9)
    p, h = np.meshgrid(phi, y, indexing="ij")
    points = np.stack([0.11 * np.sin(p), h, 0.11 * np.cos(p)], axis=-1)
    uv = np.stack([0.11 * p, h], axis=-1)
    mesh = define_grid(stage, "/World/Cylinder", Grid(points, uv))
    # Smooth normals: a facet of 1.4 degrees would show in a highlight of 2.5 degrees.
    normals = np.stack([np.sin(p), 0 * p, np.cos(p)], axis=-1)
    mesh.CreateNormalsAttr(normals.reshape(-1, 3).astype(np.float32))
    mesh.SetNormalsInterpolation("vertex")
    return mesh


def drape(stage, folder):
    source = folder / "drape.usda"
    if not source.exists():
        make_drape(folder)
    kept = Usd.Stage.Open(str(source))
    old = UsdGeom.Mesh(kept.GetPrimAtPath("/World/Cloth"))
    mesh = UsdGeom.Mesh.Define(stage, "/World/Cloth")
    for name in ("points", "faceVertexCounts", "faceVertexIndices", "subdivisionScheme", "extent"):
        mesh.GetPrim().GetAttribute(name).Set(old.GetPrim().GetAttribute(name).Get())
    st = UsdGeom.PrimvarsAPI(old).GetPrimvar("st")
    new = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", st.GetTypeName(), st.GetInterpolation())
    new.Set(st.Get())
    new.SetIndices(st.GetIndices())
    return mesh


def reference(scene, folder, light, spp):
    """Render with the bounces and the box filter of Cycles, without the sky behind the cloth."""
    picture = folder / f"{scene.stem}.reference.exr"
    if not picture.exists():
        render(
            scene, picture, width=SIZE[0], height=SIZE[1], spp=spp,
            max_bounces=BOUNCES if light == "sky" else 0,
            staging=Staging(background=(0.0, 0.0, 0.0)),
            level="far", shadow="horizon", pixel_filter="box",
        )  # fmt: skip
    return picture


def jobs_of(subject, preset, scene, folder, light):
    """What `blender_render.py` renders."""
    behind = light == "behind"
    baked = folder / f"{subject.name}.{preset}.{'behind.' if behind else ''}bake"
    if not (baked / "manifest.json").exists():
        bake(scene, baked, BakeSettings(resolution=512, fit=True))
    surfaces = ("openpbr",) if behind else ("openpbr", "lobes")
    if not (baked / "look.usda").exists():
        # The reference is level far; `blender_zoom.py` compares single threads.
        write_materials(baked, settings=Settings(surfaces=surfaces, near="off"))
    shader = folder / f"{preset}.osl"
    if light == "sun":
        write_osl(load(preset), shader)
    made = []
    for kind in KINDS[light]:
        made.append(
            {
                "material": kind,
                "addons": str(folder / "addons"),
                "layer": str(baked / "look.usda"),
                "scene": str(scene),
                "light": light,
                "picture": str(folder / f"{scene.stem}.{kind}.exr"),
                "size": SIZE,
                "spp": {"osl": 16}.get(kind, 96 if light == "sky" else 64),
                "bounces": BOUNCES if light == "sky" else 0,
                "irradiance": IRRADIANCE,
                "towards_light": (BEHIND if behind else TOWARDS).tolist(),
                "focal_length": subject.focal_length,
                "camera": [list(row) for row in look_at(subject.eye, subject.at)],
                "shader": str(shader),
            }
        )
    return made


def compare(picture, truth, block):
    """The difference where both pictures are mostly cloth, and that of their mean radiances.

    block : side of the squares of pixels whose means are compared, because noise is no difference
    """
    a, b = (shrunk(read_exr_layers(one)[0]["beauty"], block) for one in (picture, truth))
    both = (a[..., 3] > 0.5) & (b[..., 3] > 0.5)
    found = difference(a[both][None, :, :3].copy(), b[both][None, :, :3].copy())
    relative = float(a[..., :3].sum() / b[..., :3].sum() - 1.0)
    return found, relative


def shrunk(pixels, block):
    h, w = pixels.shape[0] // block, pixels.shape[1] // block
    return pixels.reshape(h, block, w, block, -1).mean(axis=(1, 3))


def parts_of(folder, light):
    """Names of the subjects and presets of which `folder` has every picture."""
    names = [f"{s.name}.{preset}.{light}" for s in (CYLINDER, GARMENT) for preset in PRESETS]
    kinds = ("reference", *KINDS[light])
    return [n for n in names if all((folder / f"{n}.{kind}.exr").exists() for kind in kinds)]


def stack(folder, names, light, out):
    """Write all rows of pictures below one another, at half size, to the PNG `out`."""
    rows = [
        np.concatenate(
            [
                read_exr_layers(folder / f"{name}.{kind}.exr")[0]["beauty"][..., :3]
                for kind in ("reference", *KINDS[light])
            ],
            axis=1,
        )
        for name in names
    ]
    pixels = np.clip(np.concatenate(rows, axis=0), 0.0, 1.0)
    small = shrunk(pixels, 2)
    write_png(out, np.rint(srgb_encode(small) * 255).astype(np.uint8))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--blender", help="a Python that can import bpy")
    parser.add_argument("--out", type=Path, default=Path("build/blender"))
    parser.add_argument("--presets", nargs="+", default=list(PRESETS))
    parser.add_argument("--subjects", nargs="+", default=["cylinder", "garment"])
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--light", choices=("sun", "sky"), default="sun")
    parser.add_argument("--behind", action="store_true", help="light through the cloth")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="only put parts together")
    options = parser.parse_args()
    light = "behind" if options.behind else options.light
    folder = options.out.resolve()
    if options.picture:
        names = parts_of(folder, light)
        if not names:
            parser.error(
                f"{folder} has no pictures under '{light}'; make some with --blender PYTHON"
            )
        stack(folder, names, light, options.picture)
        print("\n".join(names))
        return
    if not options.blender:
        parser.error("--blender is missing; it must be a Python that can import bpy")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "addons").mkdir(exist_ok=True)
    write_addon(folder / "addons" / "fabricusd_looks")
    print("| subject | preset | material | mean radiance | delta E mean | 95th |")
    print("|---|---|---|---|---|---|")
    done: list[str] = []
    for subject in (s for s in (CYLINDER, GARMENT) if s.name in options.subjects):
        for preset in options.presets:
            scene = make_scene(subject, preset, folder, light)
            truth = reference(scene, folder, light, options.spp)
            jobs = jobs_of(subject, preset, scene, folder, light)
            job = folder / f"{scene.stem}.json"
            job.write_text(json.dumps(jobs))
            log = folder / f"{scene.stem}.log"
            with log.open("w") as stream:
                run = [options.blender, str(HERE / "blender_render.py"), str(job)]
                subprocess.run(run, check=True, stdout=stream, stderr=subprocess.STDOUT)
            for one in jobs:
                error, mean = compare(Path(one["picture"]), truth, 2 if light == "sky" else 1)
                print(
                    f"| {subject.name} | {preset} | {one['material']} | {100 * mean:+.1f} % "
                    f"| {error.delta_e_mean:.2f} | {error.delta_e_95:.2f} |",
                    flush=True,
                )
            done.append(scene.stem)
    stack(folder, done, light, folder / f"side_by_side.{light}.png")


if __name__ == "__main__":
    main()

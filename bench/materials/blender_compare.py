"""Compare Cycles with the reference path tracer, for each preset and kind of material.

    python bench/materials/blender_compare.py --blender PYTHON [--out FOLDER] [--presets NAME ...]

`PYTHON` is an interpreter that can `import bpy`; `make blender` makes one. The subjects are half a
cylinder wrapped in the fabric, and a draped cloth, under one distant light without bounces. They
are rendered by fabricusd at level far and, from the baked look, by Cycles in three ways: as
UsdPreviewSurface, which is what Blender imports; through the hook of
`fabricusd/materials/targets/blender`; and with the OSL shader. The script prints a table of delta E
2000 and writes the pictures side by side.

With `--behind`, the fabrics' threads conserve energy and the light stands behind the cloth, which
shows what comes through. There is no OSL shader of such threads.
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
from fabricusd.images.files import read_exr_layers, write_png  # noqa: E402
from fabricusd.materials.materials import write_materials  # noqa: E402
from fabricusd.materials.targets.osl import write_osl  # noqa: E402
from fabricusd.quality.pictures import difference  # noqa: E402
from fabricusd.reference.render import render  # noqa: E402
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
KINDS = ("preview", "hook", "osl")
KINDS_BEHIND = ("preview", "hook")


class Subject:
    """A mesh, and the camera that sees it."""

    def __init__(self, name, eye, at, focal_length):
        self.name, self.eye, self.at, self.focal_length = name, eye, at, focal_length


CYLINDER = Subject("cylinder", (0.0, 0.14, 1.0), (0.0, 0.14, 0.0), 90.0)
GARMENT = Subject("garment", (0.55, 0.95, 1.75), (0.0, 0.24, 0.0), 60.0)


def cloth_of(preset, behind):
    fabric = load(preset)
    return replace(fabric, model="conserving", back=None) if behind else fabric


def make_scene(subject, preset, folder, behind):
    """The scene that fabricusd renders; its mesh is the one that is baked."""
    path = folder / f"{subject.name}.{preset}.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    mesh = cylinder(stage) if subject is CYLINDER else drape(stage, folder)
    dress(stage, mesh, cloth_of(preset, behind))
    light = UsdLux.DistantLight.Define(stage, "/World/Light")
    light.CreateIntensityAttr(IRRADIANCE)
    light.CreateAngleAttr(0.0)
    light.AddTransformOp().Set(
        look_at(tuple((BEHIND if behind else TOWARDS).tolist()), (0.0, 0.0, 0.0))
    )
    camera(stage, subject.eye, subject.at, subject.focal_length)
    stage.GetRootLayer().Save()
    return path


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


def reference(scene, folder, spp):
    """Render direct light only, like Cycles without bounces, with the box filter of Cycles."""
    picture = folder / f"{scene.stem}.reference.exr"
    if not picture.exists():
        render(
            scene, picture, width=SIZE[0], height=SIZE[1], spp=spp, max_bounces=0,
            level="far", shadow="horizon", pixel_filter="box",
        )  # fmt: skip
    return picture


def jobs_of(subject, preset, scene, folder, behind):
    baked = folder / f"{scene.stem}.bake"
    if not (baked / "manifest.json").exists():
        bake(scene, baked, BakeSettings(resolution=512, fit=True))
    written = write_materials(baked)
    shader = folder / f"{preset}.osl"
    if not behind:
        write_osl(load(preset), shader)
    made = []
    for kind in KINDS_BEHIND if behind else KINDS:
        made.append(
            {
                "material": kind,
                "layer": str(baked / "look.usda"),
                "picture": str(folder / f"{scene.stem}.{kind}.exr"),
                "size": SIZE,
                "spp": 64 if kind != "osl" else 16,
                "irradiance": IRRADIANCE,
                "towards_light": (BEHIND if behind else TOWARDS).tolist(),
                "focal_length": subject.focal_length,
                "camera": [list(row) for row in look_at(subject.eye, subject.at)],
                "shader": str(shader),
            }
        )
    return made, written


def compare(picture, truth):
    """The difference where both pictures are mostly cloth, and that of their mean radiances."""
    ours, _ = read_exr_layers(picture)
    real, _ = read_exr_layers(truth)
    a, b = ours["beauty"], real["beauty"]
    both = (a[..., 3] > 0.5) & (b[..., 3] > 0.5)
    found = difference(a[both][None, :, :3].copy(), b[both][None, :, :3].copy())
    relative = float(a[..., :3].sum() / b[..., :3].sum() - 1.0)
    return found, relative


def stack(folder, names, kinds):
    """Write all rows of pictures below one another, at half size, to `side_by_side.png`."""
    rows = [
        np.concatenate(
            [
                read_exr_layers(folder / f"{name}.{kind}.exr")[0]["beauty"][..., :3]
                for kind in ("reference", *kinds)
            ],
            axis=1,
        )
        for name in names
    ]
    pixels = np.clip(np.concatenate(rows, axis=0), 0.0, 1.0)
    h, w = pixels.shape[0] // 2, pixels.shape[1] // 2
    small = pixels.reshape(h, 2, w, 2, 3).mean(axis=(1, 3))
    out = folder / "side_by_side.png"
    write_png(out, np.rint(srgb_encode(small) * 255).astype(np.uint8))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--blender", required=True, help="a Python that can import bpy")
    parser.add_argument("--out", type=Path, default=Path("build/blender"))
    parser.add_argument("--presets", nargs="+", default=list(PRESETS))
    parser.add_argument("--subjects", nargs="+", default=["cylinder", "garment"])
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--behind", action="store_true", help="light through the cloth")
    options = parser.parse_args()
    folder = options.out.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    print("| subject | preset | material | mean radiance | delta E mean | 95th |")
    print("|---|---|---|---|---|---|")
    done: list[str] = []
    for subject in (s for s in (CYLINDER, GARMENT) if s.name in options.subjects):
        for preset in options.presets:
            scene = make_scene(subject, preset, folder, options.behind)
            truth = reference(scene, folder, options.spp)
            jobs, _ = jobs_of(subject, preset, scene, folder, options.behind)
            job = folder / f"{scene.stem}.json"
            job.write_text(json.dumps(jobs))
            log = folder / f"{scene.stem}.log"
            with log.open("w") as stream:
                run = [options.blender, str(HERE / "blender_render.py"), str(job)]
                subprocess.run(run, check=True, stdout=stream, stderr=subprocess.STDOUT)
            for one in jobs:
                error, mean = compare(Path(one["picture"]), truth)
                print(
                    f"| {subject.name} | {preset} | {one['material']} | {100 * mean:+.1f} % "
                    f"| {error.delta_e_mean:.2f} | {error.delta_e_95:.2f} |",
                    flush=True,
                )
            done.append(scene.stem)
    stack(folder, done, KINDS_BEHIND if options.behind else KINDS)


if __name__ == "__main__":
    main()

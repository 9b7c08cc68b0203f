"""Zoom from single threads to cloth from afar, in Cycles and in the reference.

    python bench/materials/blender_zoom.py --blender PYTHON [--out FOLDER] [--presets NAME ...]

The subject is a flat cloth of even threads, and each frame is twice as wide as the one before: from
40 pixels a thread to about 100 threads a pixel. The lobes take their threads from a texture of one
repeat (`near`, without the automatic blend); the same, blended into the cloth from afar by the
distance of the camera, as the add-on imports it (`blended`); or from nowhere (`far`). For each
frame the script prints delta E 2000 against the reference, and how far the frame is from the one
before, where both show the same cloth: the means of 2 x 2 pixels of the nearer frame against the
middle of the wider one. It writes the frames of a preset below one another: reference, and modes.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdLux

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "samples"))

from make_samples import camera, look_at  # noqa: E402

from fabricusd.bake.bake import bake  # noqa: E402
from fabricusd.bake.job import Settings as BakeSettings  # noqa: E402
from fabricusd.fabric import Binding, even  # noqa: E402
from fabricusd.images.files import read_exr_layers, write_png  # noqa: E402
from fabricusd.materials.materials import write_materials  # noqa: E402
from fabricusd.materials.recipes import Settings  # noqa: E402
from fabricusd.materials.targets.blender.pack import write_addon  # noqa: E402
from fabricusd.quality.colors import delta_e_2000  # noqa: E402
from fabricusd.reference.render import render  # noqa: E402
from fabricusd.scene.staging import Staging  # noqa: E402
from fabricusd.schema import load, write_binding, write_fabric  # noqa: E402
from fabricusd.srgb import srgb_encode  # noqa: E402

PRESETS = ("linen_plain", "silk_shot", "polyester_satin_charmeuse")
NEAREST, FRAMES, SIDE = 1.0 / 40.0, 13, 64
"""Threads that a pixel of the first frame spans, which each further frame doubles; the number of
frames; and pixels along a side."""

THREADS, PITCH = 12800, 5e-4
"""Threads along a side of the cloth, and metres of a thread."""

FOCAL, APERTURE = 150.0, 36.0
VIEW = np.array([0.25, -0.45, 0.86])
TOWARDS = np.array([-0.1, 0.62, 0.78])
"""To the viewer and to the light: near the mirror direction, off it by some 10 degrees."""

ONE, MORE = 0.5, 8
"""Threads from which a pixel takes MORE times the samples: Cycles reads textures at points."""

MODES = {"near": "repeat", "blended": "repeat", "far": "off"}


def spans():
    """Threads that a pixel spans, frame by frame."""
    return [NEAREST * 2.0**k for k in range(FRAMES)]


def eye(span):
    """Where the camera is for a pixel that spans `span` threads."""
    distance = SIDE * span * PITCH * FOCAL / APERTURE
    return tuple(float(x) for x in distance * VIEW / np.linalg.norm(VIEW))


def make_scene(fabric, folder, stem):
    path = folder / f"{stem}.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    r = 0.5 * THREADS * PITCH
    mesh = UsdGeom.Mesh.Define(stage, "/World/Cloth")
    mesh.CreatePointsAttr([(-r, -r, 0), (r, -r, 0), (r, r, 0), (-r, r, 0)])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreateExtentAttr([(-r, -r, 0), (r, r, 0)])
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
    )
    st.Set([(0, 0), (1, 0), (1, 1), (0, 1)])
    write_fabric(stage, "/World/Fabric", fabric)
    laid = Binding(fabric=fabric, threads_per_uv=(float(THREADS), float(THREADS)))
    write_binding(mesh.GetPrim(), "/World/Fabric", laid)
    sun = UsdLux.DistantLight.Define(stage, "/World/Light")
    sun.CreateIntensityAttr(math.pi)
    sun.CreateAngleAttr(0.0)
    sun.AddTransformOp().Set(look_at(tuple(TOWARDS.tolist()), (0.0, 0.0, 0.0)))
    for k, span in enumerate(spans()):
        camera(stage, eye(span), (0.0, 0.0, 0.0), FOCAL, f"Camera{k}")
        prim = stage.GetPrimAtPath(f"/World/Camera{k}")
        UsdGeom.Camera(prim).GetClippingRangeAttr().Set((1e-4, 1e5))
    stage.GetRootLayer().Save()
    return path


def references(scene, folder, stem, level, spp):
    found = []
    for k in range(FRAMES):
        picture = folder / f"{stem}.{level}.{k}.exr"
        if not picture.exists():
            render(
                scene, picture, camera=f"/World/Camera{k}", width=SIDE, height=SIDE, spp=spp,
                max_bounces=0, staging=Staging(background=(0.0, 0.0, 0.0)), level=level,
                shadow="horizon", pixel_filter="box",
            )  # fmt: skip
        found.append(picture)
    return found


def jobs_of(scene, folder, stem, spp, mode):
    baked = folder / f"{stem}.bake"
    if not (baked / "manifest.json").exists():
        bake(scene, baked, BakeSettings(resolution=64))
    look = baked / f"{mode}.usda"
    write_materials(baked, look, Settings(surfaces=("lobes",), near=MODES[mode]))
    unit = TOWARDS / np.linalg.norm(TOWARDS)
    return [
        {
            "material": "lobes", "addons": str(folder / "addons"), "layer": str(look),
            "scene": str(scene), "light": "sun", "picture": str(folder / f"{stem}.{mode}.{k}.exr"),
            "size": (SIDE, SIDE), "spp": spp * (MORE if mode == "near" and span > ONE else 1),
            "bounces": 0, "irradiance": math.pi,
            **({"give": {"Thread Width": 0.0}} if mode == "near" else {}),
            "towards_light": unit.tolist(), "focal_length": FOCAL, "clip": 1e-4,
            "camera": [list(row) for row in look_at(eye(span), (0.0, 0.0, 0.0))],
        }
        for k, span in enumerate(spans())
    ]  # fmt: skip


def cycles(blender, jobs, folder, stem):
    job = folder / f"{stem}.json"
    job.write_text(json.dumps(jobs))
    with (folder / f"{stem}.log").open("w") as stream:
        run = [blender, str(HERE / "blender_render.py"), str(job)]
        subprocess.run(run, check=True, stdout=stream, stderr=subprocess.STDOUT)
    return [Path(one["picture"]) for one in jobs]


def read(path):
    return read_exr_layers(path)[0]["beauty"][..., :3].astype(np.float64)


def halved(pixels):
    h, w, c = pixels.shape
    return pixels.reshape(h // 2, 2, w // 2, 2, c).mean(axis=(1, 3))


def step(nearer, wider):
    """Mean delta E between two frames where both show the same cloth."""
    quarter = SIDE // 4
    return float(delta_e_2000(halved(nearer), wider[quarter:-quarter, quarter:-quarter]).mean())


def strip(rows):
    return np.concatenate([np.concatenate(list(row), axis=1) for row in rows], axis=0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--blender", required=True, help="a Python that can import bpy")
    parser.add_argument("--out", type=Path, default=Path("build/zoom"))
    parser.add_argument("--presets", nargs="+", default=list(PRESETS))
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--modes", nargs="+", choices=MODES, default=list(MODES))
    parser.add_argument("--level", default="auto", help="level of the reference")
    options = parser.parse_args()
    folder = options.out.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "addons").mkdir(exist_ok=True)
    write_addon(folder / "addons" / "fabricusd_looks")
    names = " | ".join(options.modes)
    print(f"| preset | threads a pixel | delta E: {names} | step: reference | {names} |")
    print("|---" * (3 + 2 * len(options.modes)) + "|")
    for preset in options.presets:
        scene = make_scene(even(load(preset)), folder, preset)
        truth = [read(p) for p in references(scene, folder, preset, options.level, options.spp)]
        made = {}
        for mode in options.modes:
            jobs = jobs_of(scene, folder, preset, options.spp, mode)
            made[mode] = [read(p) for p in cycles(options.blender, jobs, folder, preset)]
        rows = (truth, *made.values())
        for k, span in enumerate(spans()):
            off = [float(delta_e_2000(made[mode][k], truth[k]).mean()) for mode in options.modes]
            steps = [step(row[k - 1], row[k]) if k else math.nan for row in rows]
            numbers = " | ".join(f"{x:.1f}" for x in (*off, *steps))
            print(f"| {preset} | {span:.3g} | {numbers} |", flush=True)
        pixels = srgb_encode(np.clip(strip(rows), 0.0, 1.0))
        write_png(folder / f"{preset}.png", np.rint(pixels * 255).astype(np.uint8))


if __name__ == "__main__":
    main()

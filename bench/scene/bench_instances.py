"""What instances cost: the sample skirt in linen, once and many times, placed and copied.

Prints, for each number of skirts, the seconds and the peak memory of reading and of rendering, each
run in a process of its own; then the same of a million placements of one small mesh.

    python bench/scene/bench_instances.py [--counts 1 10 1000] [--copies 1 10] [--million 1000000]
        [--native] [--compare]
"""

from __future__ import annotations

import argparse
import json
import platform
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

SIZE = (480, 270)
SAMPLES = 16


def write_stage(
    folder: Path,
    count: int,
    *,
    small: bool,
    native: bool,
    scale: tuple[float, float, float] | None = None,
) -> Path:
    """A stage on which a point instancer, or native instances, place a mesh `count` times."""
    from pxr import Gf, Sdf, Usd, UsdGeom, Vt

    from fabricusd.samples.write import write_samples
    from fabricusd.scene.read import read_scene
    from fabricusd.schema.source import PRESETS

    skirt = read_scene(write_samples(folder / "samples")[0], units="cm").meshes[0]
    stage = Usd.Stage.CreateNew(str(folder / "scene.usdc"))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, "Y")
    mesh = UsdGeom.Mesh.Define(stage, "/Protos/one/mesh")
    triangles, uv = np.asarray(skirt.triangles)[:, :3], skirt.uv
    points = skirt.points - skirt.points.mean(axis=0)
    if small:
        triangles, uv = triangles[:12], uv[:12]
        points = points / np.ptp(points[triangles].reshape(-1, 3), axis=0).max() * 0.5
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(triangles), 3))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.astype(np.int32).ravel()))
    mesh.CreateSubdivisionSchemeAttr("none")
    UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
    ).Set(Vt.Vec2fArray.FromNumpy(uv.reshape(-1, 2).astype(np.float32)))
    cloth = stage.DefinePrim("/Looks/Cloth")
    cloth.GetReferences().AddReference(str(PRESETS / "linen_plain.usda"))
    mesh.GetPrim().ApplyAPI("WovenBindingAPI")
    mesh.GetPrim().GetRelationship("fabric:binding").SetTargets([cloth.GetPath()])
    stage.GetPrimAtPath("/Protos").SetSpecifier(Sdf.SpecifierOver)
    side = int(np.ceil(count ** (1 / 3)))
    k = np.arange(count)
    grid = np.stack((k % side, k // side % side, k // side**2), axis=1) - 0.5 * (side - 1)
    turn = np.random.default_rng(1).uniform(0, 2 * np.pi, count)
    if native:
        for number in range(count):
            prim = stage.DefinePrim(f"/Many/copy{number}", "Xform")
            prim.GetReferences().AddInternalReference("/Protos/one")
            prim.SetInstanceable(True)
            move = UsdGeom.Xformable(prim)
            move.AddTranslateOp().Set(Gf.Vec3d(*grid[number].tolist()))
            move.AddRotateYOp().Set(float(np.degrees(turn[number])))
    else:
        many = UsdGeom.PointInstancer.Define(stage, "/Many")
        many.CreatePrototypesRel().SetTargets(["/Protos/one"])
        many.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(grid.astype(np.float32)))
        many.CreateProtoIndicesAttr(Vt.IntArray(count))
        # Gf's arrays hold the real part last.
        quaternions = np.zeros((count, 4), np.float32)
        quaternions[:, 1], quaternions[:, 3] = np.sin(turn / 2), np.cos(turn / 2)
        many.CreateOrientationsfAttr(Vt.QuatfArray.FromNumpy(quaternions))
        if scale is not None:
            # Those of odd numbers; a fabric without a stated scale would be measured on each size.
            mesh.GetPrim().GetAttribute("fabric:binding:threadsPerUnit").Set(Gf.Vec2d(4000, 1000))
            many.CreateScalesAttr([scale if k % 2 else (1, 1, 1) for k in range(count)])
    stage.GetRootLayer().Save()
    return folder / "scene.usdc"


def measure(path: str, *, instanced: bool) -> None:
    """Read and render a stage, and print what that took."""
    from fabricusd.reference.render import render_scene
    from fabricusd.scene.read import read_scene
    from fabricusd.scene.staging import Staging, put

    begun = time.perf_counter()
    scene = read_scene(path, complexity="auto", width=SIZE[0], instanced=instanced)
    read = time.perf_counter()
    put(Staging(frame="/"), scene, SIZE[0] / SIZE[1])
    result = render_scene(scene, width=SIZE[0], height=SIZE[1], spp=SAMPLES)
    placed = sum(len(mesh.triangles) * mesh.times for mesh in scene.meshes)
    print(json.dumps({
        "shown": placed, "stored": sum(len(mesh.triangles) for mesh in scene.meshes),
        "read": read - begun, "prepared": float(result.metadata["fabricusd:preparationSeconds"]),
        "traced": result.seconds, "rays": result.rays,
        "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "notes": [note for note in scene.notes if "left out" in note],
    }))  # fmt: skip


def told(count: int, *, small: bool = False, native: bool = False, copies: bool = False) -> None:
    """Print one line about `count` meshes."""
    with tempfile.TemporaryDirectory() as folder:
        path = write_stage(Path(folder), count, small=small, native=native)
        kind = "copies" if copies else "placed"
        run = [sys.executable, __file__, "--measure", str(path), kind]
        done = subprocess.run(run, check=True, capture_output=True, text=True)
    one = json.loads(done.stdout.splitlines()[-1])
    print(
        f"{count:9d} {kind} {one['shown']:11d} triangles shown, {one['stored']:9d} stored: "
        f"read {one['read']:6.2f} s, prepared {one['prepared']:6.2f} s, "
        f"traced {one['traced']:6.2f} s ({one['rays'] / one['traced'] / 1e6:5.2f} M rays/s), "
        f"peak {one['peak']:7.0f} MB",
        *one["notes"], flush=True,
    )  # fmt: skip


def compare(name: str, scale: tuple[float, float, float]) -> None:
    """Print how far a picture of ten placed skirts is from one of ten copies."""
    from fabricusd.reference.render import render_scene
    from fabricusd.scene.read import read_scene
    from fabricusd.scene.staging import Staging, put

    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        path = write_stage(Path(folder), 10, small=False, native=False, scale=scale)
        for instanced in (True, False):
            scene = read_scene(path, instanced=instanced)
            put(Staging(frame="/"), scene, SIZE[0] / SIZE[1])
            layers = ("beauty", "normal", "tangent")
            pictures.append(
                render_scene(scene, width=SIZE[0], height=SIZE[1], spp=SAMPLES, aovs=layers).layers
            )
    placed, copied = pictures
    seen = copied["beauty"][..., 3] > 0
    for layer in placed:
        off = np.abs(placed[layer] - copied[layer])[seen]
        mean = np.abs(copied[layer][seen]).mean()
        print(f"{name}, {layer}: mean {off.mean():.2g}, most {off.max():.2g}, of {mean:.2g}")
    # Of the whole picture, in which single paths average out.
    ratio = placed["beauty"][seen].mean(dtype=float) / copied["beauty"][seen].mean(dtype=float)
    print(f"{name}, brightness: {ratio - 1:+.1e}", flush=True)


def main() -> None:
    """Run all sizes."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--counts", type=int, nargs="*", default=[1, 10, 1000])
    options.add_argument("--copies", type=int, nargs="*", default=[1, 10])
    options.add_argument("--million", type=int, nargs="*", default=[1_000_000])
    options.add_argument("--native", action="store_true", help="native instances of the skirt")
    options.add_argument("--compare", action="store_true", help="pictures, with those of copies")
    options.add_argument("--measure", nargs=2, help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.measure:
        measure(given.measure[0], instanced=given.measure[1] == "placed")
        return
    if given.compare:
        compare("turned", (1.0, 1.0, 1.0))
        compare("mirrored", (-1.0, 1.0, 1.0))
        compare("half as large", (0.5, 0.5, 0.5))
        compare("stretched", (0.6, 1.5, 1.0))
        return
    print(f"{platform.processor() or platform.machine()}, {SIZE[0]} x {SIZE[1]}, {SAMPLES} samples")
    for count in given.counts:
        told(count, native=given.native)
    for count in given.copies:
        told(count, native=given.native, copies=True)
    for count in given.million:
        told(count, small=True)


if __name__ == "__main__":
    main()

"""Time and memory of baking large inputs: a million triangles, a jacquard of 4096 x 4096 cells.

    python bench/bake/bench_bake_bounds.py [triangles | jacquard] [--texels 256]

Each input is baked by the command line, in a process of its own. Printed are its wall time, its
processor time and its peak memory. Run it twice: the first run compiles kernels.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, Vt

POINTS = 708
"""Points along each side of the grid; its cells, of two triangles each, make 999 698 triangles."""

CELLS = 4096
"""Ends and picks of the jacquard."""


def write_wavy(path: Path) -> None:
    """A wavy square of a million triangles, with UVs in the unit square."""
    line = np.linspace(0, 1, POINTS)
    x, z = np.meshgrid(line, line, indexing="ij")
    points = np.stack([x, 0.1 * np.sin(18 * x) * np.cos(14 * z), z], axis=-1).reshape(-1, 3)
    i = np.arange(POINTS * POINTS).reshape(POINTS, POINTS)
    a, b, c, d = (i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel())
    triangles = np.concatenate([np.stack([a, d, c], 1), np.stack([a, c, b], 1)]).astype(np.int32)
    _write_mesh(path, points, triangles, points[:, [2, 0]])


def write_square(path: Path) -> None:
    """A square of two triangles."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    points = np.column_stack((corners, np.zeros(4)))
    _write_mesh(path, points, np.array([[0, 1, 2], [0, 2, 3]], np.int32), corners)


def _write_mesh(path: Path, points: np.ndarray, triangles: np.ndarray, uv: np.ndarray) -> None:
    layer = Sdf.Layer.CreateNew(str(path))
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    mesh = UsdGeom.Mesh.Define(stage, "/Cloth")
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.ravel()))
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
    )
    st.Set(Vt.Vec2fArray.FromNumpy(uv.astype(np.float32)))
    layer.Save()


def write_jacquard(path: Path) -> None:
    """A fabric whose weave is an 8-end satin with a figure of large leaves; no picks are alike."""
    from fabricusd.fabric import Fabric, Weave
    from fabricusd.schema import save

    end, pick = np.meshgrid(np.arange(CELLS), np.arange(CELLS), indexing="ij")
    satin = (5 * pick - end) % 8 == 0
    leaf = np.sin(end / 97.0 + np.cos(pick / 151.0)) * np.cos(pick / 83.0) > 0.2
    save(Fabric(name="Jacquard", weave=Weave(cells=np.where(leaf, ~satin, satin))), path)


def measured(words: list[str]) -> str:
    """Time and memory of one run of the command line."""
    began = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "fabricusd", *words], check=True, stdout=subprocess.DEVNULL
    )
    seconds = time.perf_counter() - began
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    unit = 1 if sys.platform == "darwin" else 1024
    return (
        f"{seconds:.1f} s, {used.ru_utime + used.ru_stime:.1f} s of processors, "
        f"{used.ru_maxrss * unit / 1e6:.0f} MB"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("triangles", "jacquard"))
    parser.add_argument("--texels", type=int, default=256)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scene, fabric = folder / "scene.usdc", "linen_plain"
        if options.what == "triangles":
            write_wavy(scene)
        else:
            write_square(scene)
            fabric = str(folder / "jacquard.usda")
            write_jacquard(Path(fabric))
        words = ["bake", str(scene), "--fabric", fabric, "--resolution", str(options.texels)]
        said = measured([*words, "-o", str(folder / "out")])
        print(f"{options.what} at {options.texels} texels: {said}")


if __name__ == "__main__":
    main()

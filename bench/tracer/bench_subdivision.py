"""Time and memory of refining a subdivision surface of 100 000 faces.

    python bench/tracer/bench_subdivision.py [quads|triangles] [auto|low|medium|high] [render]

Printed are the wall time and processor time to read the stage, and the peak memory; with `render`
also the peak memory of a picture of 2048 x 2048.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from bench_memory import most
from pxr import Sdf, Usd, UsdGeom, Vt

from fabricusd.reference import read_scene, render
from fabricusd.scene.surface import embree_library

SIDES = {"quads": 317, "triangles": 225}
"""Points along each side of a wavy square of 99 856 quads or 100 352 triangles."""


def write_stage(path: Path, shape: str) -> None:
    """A wavy square with UVs and without seams."""
    count = SIDES[shape]
    line = np.linspace(-1, 1, count)
    x, z = np.meshgrid(line, line, indexing="ij")
    points = np.stack([x, 0.1 * np.sin(9 * x) * np.cos(7 * z), z], axis=-1).reshape(-1, 3)
    i = np.arange(count * count, dtype=np.int32).reshape(count, count)
    a, b, c, d = (i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel(), i[1:, :-1].ravel())
    faces = np.stack([a, b, c, d], 1)
    if shape == "triangles":
        faces = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    stage = Usd.Stage.CreateNew(str(path))
    mesh = UsdGeom.Mesh.Define(stage, "/cloth")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    counts = np.full(len(faces), faces.shape[1], np.int32)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(counts))
    indices = Vt.IntArray.FromNumpy(np.ascontiguousarray(faces.ravel()))
    mesh.CreateFaceVertexIndicesAttr(indices)
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
    )
    primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(points[:, [0, 2]], np.float32)))
    primvar.SetIndices(indices)
    stage.GetRootLayer().Save()


def main() -> None:
    shape = sys.argv[1] if len(sys.argv) > 1 else "quads"
    complexity = sys.argv[2] if len(sys.argv) > 2 else "high"
    assert embree_library.library() is not None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cloth.usdc"
        write_stage(path, shape)
        before = most()
        wall, busy = time.perf_counter(), time.process_time()
        [mesh] = read_scene(path, complexity=complexity, width=2048).meshes
        wall, busy = time.perf_counter() - wall, time.process_time() - busy
        print(
            f"{shape}, {complexity}: {len(mesh.triangles)} triangles in {wall:.2f} s, "
            f"{busy:.2f} s of the processor; {before:.0f} MB before, {most():.0f} MB at most"
        )
        if "render" in sys.argv:
            del mesh
            render(
                path, None, width=2048, height=2048, spp=1, level="far", fabric="silk_shot",
                complexity=complexity,
            )  # fmt: skip
            print(f"a picture: {most():.0f} MB at most")


if __name__ == "__main__":
    main()

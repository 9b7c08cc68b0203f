"""Seconds to read a million triangles from each format.

    python bench/scene/bench_mesh_files.py [SIDE]

trimesh and tinyobjloader are timed beside our readers, if they are installed.
"""

from __future__ import annotations

import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[2] / "tests")]

from reference.mesh_files import Gltf, ply  # noqa: E402

from fabricusd.scene.files.mesh_file import READERS  # noqa: E402

SIDE = int(sys.argv[1]) if len(sys.argv) > 1 else 708


def grid():
    """Points (n, 3), UVs (n, 2) and triangles (m, 3) of a wavy square."""
    u, v = np.meshgrid(np.linspace(0, 1, SIDE), np.linspace(0, 1, SIDE))
    points = np.stack([u, v, 0.1 * np.sin(7 * u) * np.cos(5 * v)], axis=-1).reshape(-1, 3)
    at = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
    quads = np.stack([at, at + 1, at + SIDE + 1, at + SIDE], axis=1)
    return points, points[:, :2], np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def write(folder: Path) -> list[Path]:
    points, uv, triangles = grid()
    rows = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points.tolist()]
    rows += [f"vt {x:.6f} {y:.6f}" for x, y in uv.tolist()]
    rows += [f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in (triangles + 1).tolist()]
    (folder / "x.obj").write_text("\n".join(rows))
    both = np.column_stack([points, uv])
    for form in ("ascii", "binary_little_endian"):
        text = ply(form, both, triangles.tolist(), "x y z s t")
        (folder / f"{form}.ply").write_bytes(text)
    made = Gltf()
    place = {"POSITION": made.add(points.astype("f4")), "TEXCOORD_0": made.add(uv.astype("f4"))}
    index = made.add(triangles.ravel().astype("u4"))
    made.node(name="x", mesh=made.mesh({"attributes": place, "indices": index}))
    (folder / "x.glb").write_bytes(made.glb())
    return sorted(folder.iterdir())


def others(path: Path):
    """(name, reader) for each library that is installed."""
    try:
        trimesh = import_module("trimesh")
        yield "trimesh", lambda: trimesh.load_scene(path, process=False)
    except ImportError:
        pass
    if path.suffix == ".obj":
        try:
            reader = import_module("tinyobjloader").ObjReader()
            yield "tinyobjloader", lambda: reader.ParseFromFile(str(path))
        except ImportError:
            pass


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        for file in write(Path(folder)):
            ours = [("fabricusd", lambda file=file: READERS[file.suffix](file))]
            for name, read in (*ours, *others(file)):
                begun = time.process_time()
                read()
                print(f"{file.name:24} {name:14} {time.process_time() - begun:6.2f} s", flush=True)

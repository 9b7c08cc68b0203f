"""Compare our subdivision surfaces with those of OpenSubdiv, which Blender uses.

    python bench/materials/blender_subdivision.py --blender PYTHON

`PYTHON` is an interpreter that can `import bpy`; `make blender` makes one in `build/bpy`. The
script prints the largest distance of our points from Blender's for each cage of the tests, whose
edges have length 1 or 2, and that of our texture coordinates for each rule and each layout of UV
charts on a sheet.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
LEVEL = 2

RULES = {
    "none": "SMOOTH_ALL",
    "cornersOnly": "PRESERVE_CORNERS",
    "cornersPlus1": "PRESERVE_CORNERS_AND_JUNCTIONS",
    "cornersPlus2": "PRESERVE_CORNERS_JUNCTIONS_AND_CONCAVE",
    "boundaries": "PRESERVE_BOUNDARIES",
    "all": "NONE",
}
"""USD's name of a rule -> Blender's name."""


def inside_blender(source: Path, target: Path) -> None:
    """Refine every cage of `source`; runs in Blender's Python."""
    import bpy

    found = {}
    for name, case in json.loads(source.read_text()).items():
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(case["points"], [], case["faces"])
        # Blender takes a crease from 0 to 1, squares it, and multiplies it by 10.
        crease = mesh.attributes.new("crease_edge", "FLOAT", "EDGE").data
        wanted = {tuple(sorted(e)): s for e, s in case["crease"]}
        for k, edge in enumerate(mesh.edges):
            crease[k].value = (wanted.get(tuple(sorted(edge.vertices)), 0) / 10) ** 0.5
        sharp = mesh.attributes.new("crease_vert", "FLOAT", "POINT").data
        for point, sharpness in case["sharp"]:
            sharp[point].value = (sharpness / 10) ** 0.5
        layer = mesh.uv_layers.new(name="st")
        for k, uv in enumerate(case["uv"]):
            layer.data[k].uv = uv
        solid = bpy.data.objects.new(name, mesh)
        bpy.context.scene.collection.objects.link(solid)
        modifier = solid.modifiers.new("limit", "SUBSURF")
        modifier.levels, modifier.quality, modifier.use_limit_surface = LEVEL, 10, True
        modifier.boundary_smooth = "PRESERVE_CORNERS" if case["corners"] else "ALL"
        modifier.uv_smooth = RULES[case["rule"]]
        made = solid.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
        found[name] = {
            "points": [list(p.co) for p in made.vertices],
            "corners": [corner.vertex_index for corner in made.loops],
            "uv": [list(corner.uv) for corner in made.uv_layers[0].data],
        }
        bpy.data.objects.remove(solid)
    target.write_text(json.dumps(found))


def cases():
    """(name, points, faces, creases and corners, UVs, rule) of the tests' cages and of a sheet with
    UV charts, the latter with every rule."""
    from tests.scene.surface.test_subdivision import CAGES, FLAPS, QUADS, SHEET, spot

    for name, (points, faces, rules, *_) in CAGES.items():
        yield name, points, faces, rules, [], "all"
    for name, (charts, _) in FLAPS.items():
        of = {k: c for c, members in enumerate(charts) for k in members}
        uv = [spot(of[k], p) for k, face in enumerate(QUADS) for p in face]
        for rule in RULES:
            yield f"{name}, {rule}", SHEET, QUADS, {}, uv, rule


def blenders(every, blender, folder):
    """Blender's refinement of every cage."""
    source, target = folder / "cages.json", folder / "refined.json"
    told = {
        name: {
            "points": [list(p) for p in points],
            "faces": [list(f) for f in faces],
            "crease": list(rules.get("crease", {}).items()),
            "sharp": list(rules.get("sharp", {}).items()),
            "corners": rules.get("corners", True),
            "uv": uv,
            "rule": rule,
        }
        for name, points, faces, rules, uv, rule in every
    }
    source.write_text(json.dumps(told))
    command = [blender, __file__, "--inside", str(source), str(target)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return json.loads(target.read_text())


def distances(ours, theirs):
    """Largest distance (of points, of coordinates or None) from our corners to Blender's nearest;
    coordinates are compared at the same point."""
    import numpy as np
    from scipy.spatial import cKDTree

    distance, at = cKDTree(theirs["points"]).query(ours.points)
    if ours.uv is None:
        return distance.max(), None
    there = {}
    for corner, value in zip(theirs["corners"], theirs["uv"], strict=True):
        there.setdefault(corner, []).append(value)
    pairs = zip(at[ours.triangles].ravel(), ours.uv.reshape(-1, 2), strict=True)
    return distance.max(), max(np.abs(np.array(there[p]) - v).max(axis=1).min() for p, v in pairs)


def main() -> None:
    sys.path.insert(0, str(HERE.parent))
    from tests.reference.stages import new_stage
    from tests.scene.surface.test_subdivision import cage, coordinates, refined

    every = list(cases())
    with tempfile.TemporaryDirectory() as folder:
        found = blenders(every, sys.argv[sys.argv.index("--blender") + 1], Path(folder))
        for k, (name, points, faces, rules, uv, rule) in enumerate(every):
            own = Path(folder) / str(k)
            own.mkdir()
            stage = new_stage(own)
            mesh = cage(stage, points, faces, **rules)
            mesh.CreateFaceVaryingLinearInterpolationAttr(rule)
            if uv:
                coordinates(mesh, uv)
            moved, slid = distances(refined(stage), found[name])
            print(f"{name:40s} {moved:.1e}" + ("" if slid is None else f"   uv {slid:.1e}"))


if __name__ == "__main__":
    if "--inside" in sys.argv:
        inside_blender(*map(Path, sys.argv[sys.argv.index("--inside") + 1 :]))
    else:
        main()

"""Subdivision surfaces of a stage against Catmull-Clark subdivision written for the purpose."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from pxr import Gf, Sdf, UsdGeom, UsdShade
from scipy.spatial import cKDTree

from fabricusd.reference.triangles import build_tables
from tests.reference.catmull_clark import FOREVER, limit_of
from tests.reference.stages import new_stage, read

CUBE = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
EDGES = sorted({(min(e), max(e)) for f in SIDES for e in zip(f, f[1:] + f[:1], strict=True)})
TOP = [e for e in EDGES if CUBE[e[0]][1] > 0 and CUBE[e[1]][1] > 0]
SHEET = [(i, j, 0.4 * math.sin(i) + 0.3 * math.cos(2 * j)) for i in range(4) for j in range(4)]
QUADS = [(4 * i + j, 4 * i + 4 + j, 4 * i + 5 + j, 4 * i + 1 + j)
         for i in range(3) for j in range(3)]  # fmt: skip
THIRDS = [t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))]
ROUND = [k * 2 * math.pi / 7 for k in range(7)]
PRISM = [(math.cos(a), math.sin(a), z) for z in (-1, 1) for a in ROUND]
HEPTAGONS = [tuple(range(6, -1, -1)), tuple(range(7, 14))]
HEPTAGONS += [(k, (k + 1) % 7, 7 + (k + 1) % 7, 7 + k) for k in range(7)]
ROOFED = [*SIDES[:3], (2, 3, 8), (3, 7, 8), (7, 6, 8), (6, 2, 8), *SIDES[4:]]


def every(edges, sharpness):
    return dict.fromkeys(edges, sharpness)


CAGES = {
    # name: (points, faces, rules, tolerance of points, of normals [degrees])
    "a cube": (CUBE, SIDES, {}, 1e-6, 0.1),
    "a sheet": (SHEET, QUADS, {}, 1e-6, 0.1),
    "triangles": (SHEET, THIRDS, {}, 1e-6, 0.2),
    "a heptagonal prism": (PRISM, HEPTAGONS, {}, 1e-6, 0.1),
    "triangles, quads and points of five": ([*CUBE, (0, 2, 0)], ROOFED, {}, 1e-6, 0.1),
    "all edges for ever sharp": (CUBE, SIDES, {"crease": every(EDGES, FOREVER)}, 1e-3, 0.1),
    "a rim for ever sharp": (CUBE, SIDES, {"crease": every(TOP, FOREVER)}, 1e-3, 0.1),
    # No stencil ends a crease at once: the four steps to compare with are that far from the limit.
    "a crease that ends": (CUBE, SIDES, {"crease": {(0, 1): FOREVER}}, 3e-3, 2.0),
    "all edges sharp for two steps": (CUBE, SIDES, {"crease": every(EDGES, 2.0)}, 1e-6, 0.1),
    "a rim sharp for a step and a half": (CUBE, SIDES, {"crease": every(TOP, 1.5)}, 1e-6, 1.0),
    "all edges barely sharp": (CUBE, SIDES, {"crease": every(EDGES, 0.6)}, 1e-6, 0.1),
    "a sharp point": (CUBE, SIDES, {"sharp": {0: FOREVER}}, 1e-6, 0.1),
    "a point sharp for a step and a half": (CUBE, SIDES, {"sharp": {0: 1.5}}, 1e-6, 0.1),
    "a crease up to the border": (
        SHEET, QUADS, {"crease": every([(1, 5), (5, 9), (9, 13)], FOREVER)}, 1e-3, 0.1
    ),
    # Embree's B-spline of a rounded corner is off by this share of an edge, beside the corner.
    "rounded corners": (SHEET, QUADS, {"corners": False}, 1e-2, 0.2),
}  # fmt: skip


def cage(stage, points, faces, crease=None, sharp=None, corners=True, path="/mesh"):
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([Gf.Vec3f(*p) for p in points])
    mesh.CreateFaceVertexCountsAttr([len(f) for f in faces])
    mesh.CreateFaceVertexIndicesAttr([p for f in faces for p in f])
    if crease:
        mesh.CreateCreaseIndicesAttr([p for e in crease for p in e])
        mesh.CreateCreaseLengthsAttr([2] * len(crease))
        mesh.CreateCreaseSharpnessesAttr(list(crease.values()))
    if sharp:
        mesh.CreateCornerIndicesAttr(list(sharp))
        mesh.CreateCornerSharpnessesAttr(list(sharp.values()))
    mesh.CreateInterpolateBoundaryAttr("edgeAndCorner" if corners else "edgeOnly")
    return mesh


def refined(stage, complexity="high", **settings):
    scene = read(stage, complexity=complexity, **settings)
    assert not scene.notes
    return scene.meshes[0]


@pytest.mark.parametrize("name", CAGES)
def test_points_and_normals_are_those_of_the_limit(tmp_path, name):
    points, faces, rules, tolerance, degrees = CAGES[name]
    stage = new_stage(tmp_path)
    cage(stage, points, faces, **rules)
    mesh = refined(stage)
    expected, normals = limit_of(points, faces, 2, 4, **rules)
    distance, which = cKDTree(expected).query(mesh.points)
    assert sorted(which) == list(range(len(expected)))
    assert distance.max() < tolerance
    there = normals[which[mesh.triangles]]
    known = np.isfinite(there[..., 0])
    cosine = (mesh.normals * there).sum(-1)[known]
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < degrees


def test_a_cube_ends_where_its_stencils_say(tmp_path):
    stage = new_stage(tmp_path)
    cage(stage, CUBE, SIDES)
    corners = [p for p in refined(stage, "veryhigh").points if np.ptp(np.abs(p)) < 1e-5]
    # (9 P + 4 E + F) / 24 for P = (1, 1, 1): 12 / 24 in each coordinate.
    assert np.sort(np.abs(corners).ravel()) == pytest.approx(np.full(24, 0.5), abs=1e-6)


@pytest.mark.parametrize("name", ["a cube", "triangles", "a heptagonal prism"])
@pytest.mark.parametrize("complexity", ["medium", "high", "veryhigh"])
def test_there_are_no_cracks(tmp_path, name, complexity):
    points, faces, *_ = CAGES[name]
    stage = new_stage(tmp_path)
    cage(stage, points, faces)
    mesh = refined(stage, complexity)
    a, b, c = mesh.triangles.T
    way = Counter(zip(np.r_[a, b, c].tolist(), np.r_[b, c, a].tolist(), strict=True))
    assert set(way.values()) == {1}
    border = sum((b, a) not in way for a, b in way)
    level = ("medium", "high", "veryhigh").index(complexity) + 1
    cage_edges = Counter(frozenset(e) for f in faces for e in zip(f, f[1:] + f[:1], strict=True))
    assert border == 2**level * list(cage_edges.values()).count(1)
    used = len(np.unique(mesh.triangles))
    assert used == len(mesh.points) == len(np.unique(np.round(mesh.points, 6), axis=0))
    euler = used - (len(way) + border) // 2 + len(mesh.triangles)
    assert euler == len(points) - len(cage_edges) + len(faces)


def test_a_crease_has_a_normal_for_each_side_and_a_smooth_edge_has_one(tmp_path):
    stage = new_stage(tmp_path)
    cage(stage, CUBE, SIDES, crease=every(TOP, FOREVER))
    mesh = refined(stage)
    lid = np.isclose(mesh.points[mesh.triangles][..., 1], 1, atol=2e-3).all(axis=1)
    assert mesh.normals[lid][..., 1] == pytest.approx(1, abs=1e-4)
    rim = np.isin(mesh.triangles, mesh.triangles[lid]) & ~lid[:, None]
    assert rim.sum() > 30
    assert np.abs(mesh.normals[rim][:, 1]).max() < 0.5
    for number in np.unique(mesh.triangles[~rim & ~lid[:, None]]):
        one = mesh.normals[mesh.triangles == number]
        assert np.ptp(one, axis=0).max() < 5e-3


ORIENTATIONS = {
    "right-handed": ("rightHanded", 1, 1),
    "left-handed": ("leftHanded", 1, -1),
    "mirrored": ("rightHanded", -1, 1),
    "left-handed and mirrored": ("leftHanded", -1, -1),
}


@pytest.mark.parametrize("name", ORIENTATIONS)
def test_triangles_and_normals_face_the_front(tmp_path, name):
    orientation, scale, sign = ORIENTATIONS[name]
    stage = new_stage(tmp_path, metres=0.01)
    mesh = cage(stage, CUBE, SIDES)
    mesh.CreateOrientationAttr(orientation)
    # The first face winds inwards of these sides.
    xform = UsdGeom.XformCommonAPI(mesh)
    xform.SetScale((3 * scale, 2, 1))
    xform.SetTranslate((50, 0, 0))
    found = refined(stage)
    p = found.points[found.triangles]
    middle = np.array([0.5, 0, 0])
    outwards = np.sign(
        np.einsum("ij,ij->i", np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), p[:, 0] - middle)
    )
    assert set(outwards) == {sign}
    assert (np.einsum("ijk,ijk->ij", found.normals, p - middle) * sign > 0).all()
    assert np.abs(p - middle).max(axis=(0, 1)) == pytest.approx(
        np.array([0.03, 0.02, 0.01]) * 0.8395, rel=1e-3
    )


def test_authored_normals_are_ignored(tmp_path):
    stage = new_stage(tmp_path)
    mesh = cage(stage, CUBE, SIDES)
    mesh.CreateNormalsAttr([Gf.Vec3f(1, 0, 0)] * 8)
    for complexity in ("low", "high"):
        [found] = read(stage, complexity=complexity).meshes
        assert found.normals is None or np.ptp(found.normals[..., 0]) > 1


def test_holes_are_not_drawn_and_shape_the_surface_all_the_same(tmp_path):
    stage = new_stage(tmp_path)
    whole = cage(stage, CUBE, SIDES)
    before = refined(stage)
    whole.CreateHoleIndicesAttr([3])
    after = refined(stage)
    assert len(after.triangles) == len(before.triangles) * 5 // 6
    assert cKDTree(before.points).query(after.points)[0].max() < 1e-9


def test_without_boundary_interpolation_the_faces_at_the_border_are_hidden(tmp_path):
    stage = new_stage(tmp_path)
    mesh = cage(stage, SHEET, QUADS)
    whole = refined(stage)
    mesh.CreateInterpolateBoundaryAttr("none")
    inner = refined(stage)
    assert len(inner.triangles) * 9 == len(whole.triangles)
    assert inner.points[:, :2].min() > 0.99
    assert inner.points[:, :2].max() < 2.01


def test_subsets_keep_their_materials(tmp_path):
    stage = new_stage(tmp_path)
    mesh = cage(stage, CUBE, SIDES)
    red = UsdShade.Material.Define(stage, "/red")
    shader = UsdShade.Shader.Define(stage, "/red/shader")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set((1, 0, 0))
    red.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    subset = UsdGeom.Subset.CreateGeomSubset(mesh, "lid", UsdGeom.Tokens.face, [3])
    UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(red)
    scene = read(stage, complexity="high")
    [found] = scene.meshes
    reds = [getattr(scene.materials[k], "diffuse", None) == (1, 0, 0) for k in found.material]
    heights = found.points[found.triangles][..., 1].mean(axis=1)
    assert sum(reds) * 6 == len(reds)
    assert heights[reds].min() > 0.5


def test_time_samples_of_points_move_the_surface(tmp_path):
    stage = new_stage(tmp_path)
    attribute = cage(stage, CUBE, SIDES).GetPointsAttr()
    for time, size in ((1, 1.0), (2, 3.0)):
        attribute.Set([Gf.Vec3f(*(size * x for x in p)) for p in CUBE], time)
    one, two = (refined(stage, time_code=t).points for t in (1, 2))
    assert two == pytest.approx(3 * one, abs=1e-5)


def test_a_bilinear_surface_is_its_cage_and_not_complained_of(tmp_path):
    stage = new_stage(tmp_path)
    cage(stage, CUBE, SIDES).CreateSubdivisionSchemeAttr("bilinear")
    mesh = refined(stage)
    assert len(mesh.triangles) == 12
    records = build_tables(read(stage)).records
    assert np.sort(np.abs(records[:, 9:12]), axis=1) == pytest.approx(
        np.tile([0.0, 0.0, 1.0], (12, 1)), abs=1e-6
    )

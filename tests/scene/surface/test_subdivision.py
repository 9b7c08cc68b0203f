"""Subdivision surfaces of a stage against Catmull-Clark subdivision written for the purpose."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from pxr import Gf, Sdf, UsdGeom, UsdShade
from scipy.spatial import cKDTree

from fabricusd.errors import FabricError
from fabricusd.reference.rays.triangles import build_tables
from fabricusd.reference.render import render
from fabricusd.scene.surface import embree_library, subdivision
from fabricusd.scene.usd import mesh as usd_mesh
from tests.reference.stages import bind_fabric, new_stage, read
from tests.scene.surface.cages import (
    CAGES,
    CUBE,
    QUADS,
    ROOFED,
    SHEET,
    SIDES,
    THIRDS,
    TOP,
    cage,
    every,
)
from tests.scene.surface.catmull_clark import FOREVER, limit_of
from tests.scene.usd.test_stage import ORIENTATIONS


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


@pytest.mark.parametrize("name", ORIENTATIONS)
def test_triangles_and_normals_face_the_front(tmp_path, name):
    orientation, scale, sign = ORIENTATIONS[name]
    stage = new_stage(tmp_path, metres=0.01)
    mesh = cage(stage, CUBE, SIDES)
    mesh.CreateOrientationAttr(orientation)
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


def test_far_from_the_origin_the_shape_is_kept(tmp_path):
    stage = new_stage(tmp_path)
    # The last point belongs to no face.
    mesh = cage(stage, [*((x + 4096, y, z) for x, y, z in CUBE), (0, 0, 0)], SIDES)
    coordinates(mesh, [(1e4 + u, v) for u, v in [(0, 0), (1, 0), (1, 1), (0, 1)] * 6])
    far = refined(stage)
    cage(stage, CUBE, SIDES)
    coordinates(mesh, [(0, 0), (1, 0), (1, 1), (0, 1)] * 6)
    near = refined(stage)
    assert far.points - (4096, 0, 0) == pytest.approx(near.points, abs=1e-6)
    assert far.uv - (1e4, 0) == pytest.approx(near.uv, abs=1e-6)


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


def test_an_edge_of_three_faces_stays_where_it_is(tmp_path):
    stage = new_stage(tmp_path)
    pages = [
        (0, 0, 0),
        (0, 1, 0),
        (1, 0, 0),
        (1, 1, 0),
        (-1, 0, 1),
        (-1, 1, 1),
        (-1, 0, -1),
        (-1, 1, -1),
    ]
    cage(stage, pages, [(0, 2, 3, 1), (0, 4, 5, 1), (0, 1, 7, 6)])
    mesh = refined(stage)
    spine = (np.abs(mesh.points[:, [0, 2]]) < 1e-6).all(axis=1)
    assert np.sort(mesh.points[spine, 1]) == pytest.approx([0, 0.25, 0.5, 0.75, 1], abs=1e-6)
    p = mesh.points[mesh.triangles]
    flat = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    flat /= np.linalg.norm(flat, axis=1)[:, None]
    # Each page has its own normals up to the spine, one of them wound against another.
    assert np.einsum("ijk,ik->ij", mesh.normals, flat).min() > 0.9


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


def coordinates(mesh, values, interpolation="faceVarying", indices=None):
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, interpolation
    )
    primvar.Set([Gf.Vec2f(*v) for v in values])
    if indices is not None:
        primvar.SetIndices(indices)


FLAT = [p[:2] for p in SHEET]
SHARED = {
    "vertex": (FLAT, None),
    "face-varying": ([FLAT[p] for f in QUADS for p in f], None),
    "face-varying with indices": (FLAT, [p for f in QUADS for p in f]),
}


@pytest.mark.parametrize("name", SHARED)
def test_coordinates_that_faces_share_follow_the_surface(tmp_path, name):
    stage = new_stage(tmp_path)
    mesh = cage(stage, SHEET, QUADS)
    values, indices = SHARED[name]
    coordinates(mesh, values, name.split()[0].replace("-v", "V"), indices)
    found = refined(stage)
    assert found.uv == pytest.approx(found.points[found.triangles][..., :2], abs=2e-6)


def test_varying_and_uniform_coordinates_follow_the_cage(tmp_path):
    stage = new_stage(tmp_path)
    bent = [(x, y * (1 + 0.3 * x)) for x, y in FLAT]
    coordinates(cage(stage, SHEET, QUADS, path="/a"), bent, "varying")
    coordinates(cage(stage, SHEET, QUADS, path="/b"), [(k, 0) for k in range(9)], "uniform")
    varying, uniform = read(stage, complexity="high").meshes
    quarters = np.round(varying.uv[..., 0] * 4, 5)
    assert np.array_equal(quarters, np.round(quarters))
    x, y = np.moveaxis(varying.uv, 2, 0)
    assert y / (1 + 0.3 * x) * 4 == pytest.approx(np.round(y / (1 + 0.3 * x) * 4), abs=1e-5)
    assert np.bincount(uniform.uv[..., 0].ravel().astype(int)).tolist() == [96] * 9


FLAPS = {
    # name: charts of the nine quads, and the (chart, point) that each rule adds to keep in place
    "a seam round a corner": (
        [{0}, set(range(1, 9))],
        {
            "none": set(),
            "cornersOnly": {(0, 1), (0, 4), (0, 5), (1, 1), (1, 4)},
            "cornersPlus1": {(0, 1), (0, 4), (0, 5), (1, 1), (1, 4)},
            "cornersPlus2": {(0, 1), (0, 4), (0, 5), (1, 1), (1, 4), (1, 5)},
        },
    ),
    "three charts around a point": (
        [{0}, {1}, set(range(2, 9))],
        {
            "cornersOnly": {(0, 1), (0, 4), (0, 5), (1, 1), (1, 2), (1, 5), (1, 6), (2, 2), (2, 4)},
            "cornersPlus1": {
                (0, 1), (0, 4), (0, 5), (1, 1), (1, 2), (1, 5), (1, 6), (2, 2), (2, 4), (2, 5)
            },
        },
    ),
}  # fmt: skip
"""Points 1 and 4 lie on the border, one step from the corner 0; 5 and 6 lie inside."""


def expected_coordinates(charts, sharp):
    """Limit of the charts, each torn from the others, with `sharp` and the sheet's corners kept."""
    number = {}
    faces = []
    for k, face in enumerate(QUADS):
        chart = next(c for c, members in enumerate(charts) if k in members)
        faces.append([number.setdefault((chart, p), len(number)) for p in face])
    points = [(*spot(c, p), 0) for c, p in number]
    sharp = sharp | {key for key in number if key[1] in (0, 3, 12, 15)}
    kept = {number[key]: FOREVER for key in sharp}
    return points, faces, limit_of(points, faces, 2, 4, sharp=kept, corners=False)[0][:, :2]


def spot(chart, p):
    x, y = FLAT[p]
    return (x + 0.2 * math.sin(2 * y) + 10 * chart, y + 0.1 * x * x)


RULED = [(name, rule) for name, (_, rules) in FLAPS.items() for rule in (*rules, "boundaries")]


@pytest.mark.parametrize(("name", "rule"), RULED)
def test_seams_of_coordinates_follow_the_rule(tmp_path, name, rule):
    charts, rules = FLAPS[name]
    border = {(c, p) for c in range(len(charts)) for p in range(16) if p not in (9, 10)}
    inside = {(len(charts) - 1, p) for p in (6,)} if name == "a seam round a corner" else set()
    present = {(c, p) for c, ks in enumerate(charts) for k in ks for p in QUADS[k]}
    sharp = (border - inside) & present if rule == "boundaries" else rules[rule]
    points, faces, expected = expected_coordinates(charts, sharp)
    stage = new_stage(tmp_path)
    mesh = cage(stage, SHEET, QUADS)
    mesh.CreateFaceVaryingLinearInterpolationAttr(rule)
    coordinates(mesh, [p[:2] for p in points], indices=[p for f in faces for p in f])
    found = refined(stage).uv.reshape(-1, 2)
    # A corner that is rounded is only near: see "rounded corners" above.
    tolerance = 1e-5 if rule != "none" else 1e-2
    assert cKDTree(expected).query(found)[0].max() < tolerance
    assert cKDTree(found).query(expected)[0].max() < tolerance


def test_all_linear_coordinates_are_bilinear_in_each_face(tmp_path):
    stage = new_stage(tmp_path)
    mesh = cage(stage, SHEET, QUADS)
    mesh.CreateFaceVaryingLinearInterpolationAttr("all")
    coordinates(mesh, [(0, 0), (1, 0), (1, 1), (0, 1)] * 9)
    uv = refined(stage).uv
    assert set(np.unique(uv)) == {0, 0.25, 0.5, 0.75, 1}
    assert 0.5 * twice_area(uv) == pytest.approx(np.full(len(uv), 1 / 32))


def twice_area(uv):
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def test_a_coordinate_seam_that_ends_inside_is_kept_by_cornersPlus2_alone(tmp_path):
    values = [list(FLAT[p]) for f in QUADS for p in f]
    # The edge from point 4 to point 5 is torn at the border, between faces 0 and 3.
    values[QUADS[0].index(4)] = [1, -0.5]
    kept = {}
    for rule in ("cornersOnly", "cornersPlus1", "cornersPlus2"):
        (tmp_path / rule).mkdir()
        stage = new_stage(tmp_path / rule)
        mesh = cage(stage, SHEET, QUADS)
        mesh.CreateFaceVaryingLinearInterpolationAttr(rule)
        coordinates(mesh, values)
        found = refined(stage)
        at = np.linalg.norm(found.uv - (1, 1), axis=2).min()
        kept[rule] = bool(at < 1e-6)
    assert kept == {"cornersOnly": False, "cornersPlus1": False, "cornersPlus2": True}


def test_a_fabric_keeps_its_scale(tmp_path):
    stage = new_stage(tmp_path, metres=0.01)
    mesh = cage(stage, SHEET, QUADS)
    coordinates(mesh, FLAT, "vertex")
    bind_fabric(stage, mesh.GetPrim())
    mesh.GetPrim().GetAttribute("fabric:binding:threadsPerUnit").Set(Gf.Vec2d(8, 8))
    found = refined(stage)
    tables = build_tables(read(stage, complexity="high"))
    area2 = np.cross(tables.records[:, 3:6], tables.records[:, 6:9])
    steep = np.linalg.norm(area2, axis=1)
    rates = tables.records[:, 34] * tables.records[:, 35]
    assert np.median(rates * steep / (64 * twice_area(found.uv))) == pytest.approx(1, abs=0.1)


FAULTS = {
    # name: (attribute, value, words of the note)
    "lengths that do not add up": (
        "creaseLengths", [3], "/mesh creaseLengths add up to 3; they must to the 2 indices"
    ),
    "a crease of one point": ("creaseLengths", [1], "/mesh creaseLengths has 1; each must be at"),
    "too many sharpnesses": (
        "creaseSharpnesses", [1, 2], "/mesh creaseSharpnesses has 2 values; it must have 1"
    ),
    "a negative sharpness": (
        "creaseSharpnesses", [-2], "/mesh creaseSharpnesses has -2; each must be at least 0"
    ),
    "a sharpness that is no number": (
        "creaseSharpnesses", [math.nan], "/mesh creaseSharpnesses has nan; each must be at least 0"
    ),
    "a crease where no edge is": (
        "creaseIndices", [0, 7], "/mesh creaseIndices has the edge 0 to 7; it must be one of a face"
    ),
    "a crease beyond the points": (
        "creaseIndices", [0, 70], "/mesh creaseIndices has the edge 0 to 70; it must be one of"
    ),
    "corners without sharpness": (
        "cornerIndices", [1], "/mesh cornerSharpnesses has 0 values; it must have 1"
    ),
    "a hole beyond the faces": (
        "holeIndices", [9], "/mesh holeIndices has 9; it must be from 0 to 8"
    ),
    "an unknown boundary": (
        "interpolateBoundary", "edges", "/mesh interpolateBoundary is 'edges'; it must be one of"
    ),
    "an unknown rule": (
        "faceVaryingLinearInterpolation", "soft", "/mesh faceVaryingLinearInterpolation is 'soft'"
    ),
    "smooth triangles": (
        "triangleSubdivisionRule", "smooth", "/mesh has triangleSubdivisionRule 'smooth'"
    ),
    "points that are not finite": (
        "points", [(math.nan, 0, 0), *CUBE[1:8], (0, 2, 0)],
        "/mesh has 1 points that are not finite; 3 faces are left out"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_what_is_wrong_is_one_line_and_the_rest_is_refined(tmp_path, name):
    attribute, value, words = FAULTS[name]
    stage = new_stage(tmp_path)
    mesh = cage(stage, [*CUBE, (0, 2, 0)], ROOFED, crease={(5, 7): 2.0})
    mesh.GetPrim().GetAttribute(attribute).Set(value)
    scene = read(stage, complexity="medium")
    assert [words in n for n in scene.notes] == [True], scene.notes
    [found] = scene.meshes
    assert len(found.triangles) >= 8 * 5
    assert np.isfinite(found.points).all()
    assert np.isfinite(found.normals).all()


def fan(count):
    turn = [2 * math.pi * k / count for k in range(count)]
    points = [(0, 0, 1), *((math.cos(a), math.sin(a), 0) for a in turn)]
    return points, [(0, 1 + k, 1 + (k + 1) % count) for k in range(count)]


def test_a_point_among_too_many_faces_leaves_the_cage(tmp_path):
    stage = new_stage(tmp_path)
    cage(stage, *fan(63), path="/most")
    cage(stage, *fan(64), path="/more")
    scene = read(stage, complexity="medium")
    [words] = scene.notes
    assert words.startswith("/more is a subdivision surface (catmullClark), rendered at its cage")
    assert [len(m.triangles) for m in scene.meshes] == [63 * 6, 64]


def test_a_polygon_of_many_corners_is_cut_first(tmp_path):
    stage = new_stage(tmp_path)
    points, sides = fan(40)
    mesh = cage(stage, points, [*sides, tuple(range(40, 0, -1))])
    coordinates(mesh, [p[:2] for p in points], "vertex")
    scene = read(stage, complexity="medium")
    [words] = scene.notes
    assert words.startswith("/mesh has a face of 40 corners (face 40)")
    [found] = scene.meshes
    assert len(found.triangles) == (40 + 38) * 6
    assert found.uv == pytest.approx(found.points[found.triangles][..., :2], abs=2e-6)


def test_loop_surfaces_and_a_missing_library_leave_the_cage(tmp_path, monkeypatch):
    stage = new_stage(tmp_path)
    cage(stage, SHEET, THIRDS).CreateSubdivisionSchemeAttr("loop")
    assert read(stage, complexity="high").notes == [
        "/mesh is a subdivision surface (loop), rendered at its cage"
    ]
    cage(stage, SHEET, THIRDS).CreateSubdivisionSchemeAttr("catmullClark")
    monkeypatch.setattr(embree_library, "library", lambda: None)
    scene = read(stage, complexity="high")
    assert len(scene.meshes[0].triangles) == len(THIRDS)
    assert [n.endswith("Embree's own library is not here") for n in scene.notes] == [True]


def test_what_embree_refuses_leaves_the_cage(tmp_path, monkeypatch):
    def refuse(*_):
        raise FabricError("Embree", "refuses a cage of 6 faces (4)")

    monkeypatch.setattr(subdivision, "LimitSurface", refuse)
    stage = new_stage(tmp_path)
    cage(stage, CUBE, SIDES)
    scene = read(stage, complexity="high")
    assert scene.notes == ["/mesh is rendered at its cage: Embree refuses a cage of 6 faces (4)"]
    assert len(scene.meshes[0].triangles) == 12


def test_a_surface_that_would_be_too_large_is_refined_less(tmp_path, monkeypatch):
    monkeypatch.setattr(usd_mesh, "MOST_TRIANGLES", 300)
    stage = new_stage(tmp_path)
    cage(stage, CUBE, SIDES, path="/a")
    cage(stage, CUBE, SIDES, path="/b")
    scene = read(stage, complexity="high")
    assert [len(m.triangles) for m in scene.meshes] == [192, 48]
    assert [n.split(":")[0] for n in scene.notes] == ["/b has its edges halved 1 times, not 2"]


def test_frames_and_complexity_reach_the_picture(tmp_path):
    stage = new_stage(tmp_path)
    attribute = cage(stage, CUBE, SIDES).GetPointsAttr()
    for time, size in ((1, 1.0), (2, 0.2)):
        attribute.Set([Gf.Vec3f(*(size * x for x in p)) for p in CUBE], time)
    UsdGeom.XformCommonAPI(UsdGeom.Camera.Define(stage, "/cam")).SetTranslate((0, 0, 6))
    stage.GetRootLayer().Save()
    path = stage.GetRootLayer().realPath
    settings = {"width": 32, "height": 32, "spp": 1, "aovs": ("normal",)}
    seen = {}
    for time, complexity in ((1.0, "low"), (1.0, "high"), (2.0, "high")):
        result = render(path, frames=(time,), complexity=complexity, **settings)
        seen[time, complexity] = np.abs(result.layers["normal"]).sum(axis=2).astype(bool).sum()
        assert result.metadata["fabricusd:triangles"] == {"low": 12, "high": 192}[complexity]
    assert seen[1.0, "low"] > seen[1.0, "high"] > seen[2.0, "high"] > 0
    with pytest.raises(
        FabricError, match="complexity is 'ultra'; it must be one of auto, low, medium"
    ):
        render(path, complexity="ultra")

"""Vertices of glTF: what is joined, what is split, and which way things point."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Sdf, UsdGeom

from fabricusd.bake.layout.garment import garments
from fabricusd.materials.bake_folder import BakedLay, MapSet
from fabricusd.materials.targets.gltf.corners import Corners, parts, placed_corners, vertices
from fabricusd.scene.read import read_scene
from fabricusd.schema import load
from tests.reference.stages import new_stage


def two_quads(u):
    """Two unit quads beside each other in z = 0; u : of the columns x = 0, 1, 2."""
    points = np.array([(x, y, 0.0) for y in (0, 1) for x in (0, 1, 2)], np.float32)
    faces = np.array([(0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4)])
    uv = np.array([(u[x], y) for y in (0, 1) for x in (0, 1, 2)], np.float32)[faces]
    sign = np.repeat([np.sign(u[1] - u[0]), np.sign(u[2] - u[1])], 2)
    tangents = np.zeros((4, 3, 4), np.float32)
    tangents[..., 0] = sign[:, None]
    # In the plane, v points along y: the bitangent's sign is that of u.
    tangents[..., 3] = sign[:, None]
    normals = np.zeros((4, 3, 3), np.float32)
    normals[..., 2] = 1.0
    return Corners(
        points=points[faces], normals=normals, tangents=tangents, uv=uv,
        lay=np.zeros(4, np.int32),
    )  # fmt: skip


@pytest.mark.parametrize(("u", "count"), [((0.0, 0.5, 1.0), 6), ((0.0, 1.0, 0.0), 8)])
def test_corners_that_agree_are_one_vertex_and_a_mirrored_seam_is_two(u, count):
    made = vertices(two_quads(u), up_axis="Y")
    assert len(made.position) == count
    seam = made.position[:, 0] == 1.0
    assert sorted(set(made.tangent[seam, 3])) == ([1.0] if count == 6 else [-1.0, 1.0])
    # Triangles keep their corners and their winding.
    corners = made.position[made.triangles]
    assert np.array_equal(corners, two_quads(u).points)


def test_bitangents_point_to_where_v_of_usd_increases_on_both_sides_of_a_mirrored_seam(tmp_path):
    stage = new_stage(tmp_path)
    mesh = UsdGeom.Mesh.Define(stage, "/Cloth")
    mesh.CreatePointsAttr([(x, y, 0.3 * x * y) for y in (0, 1) for x in (0, 1, 2)])
    mesh.CreateFaceVertexCountsAttr([4, 4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 4, 3, 1, 2, 5, 4])
    mesh.CreateSubdivisionSchemeAttr("none")
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
    st.Set([(u, v) for v in (0.1, 0.9) for u in (0.1, 0.9, 0.1)])
    stage.GetRootLayer().Save()
    scene = read_scene(tmp_path / "scene.usda", fabric=load("linen_plain"))
    garment = garments(scene)[0]
    lay = BakedLay(name="linen_plain", fabric=None, matrix=np.eye(2), offset=np.zeros(2))
    maps = MapSet(
        folder=tmp_path, name="Cloth", textures={}, missing=(), mesh=tmp_path / "no", prims=(),
        lays=(lay,), own_uv=True, udim=False, error={}, fingerprint="",
    )  # fmt: skip
    made = vertices(placed_corners(garment, maps), up_axis="Y")
    assert set(made.tangent[:, 3]) == {-1.0, 1.0}
    up = made.tangent[:, 3:] * np.cross(made.normal, made.tangent[:, :3])
    corner = made.triangles
    p, v = made.position[corner], 1.0 - made.uv[corner][..., 1]
    for k in range(len(corner)):
        # The gradient of v over a triangle, from its edges.
        edges = np.stack((p[k, 1] - p[k, 0], p[k, 2] - p[k, 0], np.cross(*(p[k, 1:] - p[k, 0]))))
        gradient = np.linalg.solve(edges, (v[k, 1] - v[k, 0], v[k, 2] - v[k, 0], 0.0))
        assert (up[corner[k]] @ gradient > 0.5 * np.linalg.norm(gradient)).all()


def test_z_up_is_turned_and_v_counts_from_the_top():
    made = vertices(two_quads((0.0, 0.5, 1.0)), up_axis="Z")
    assert np.allclose(made.normal, (0.0, 1.0, 0.0))
    assert np.allclose(made.position[:, 2], made.uv[:, 1] - 1.0)
    straight = vertices(two_quads((0.0, 0.5, 1.0)), up_axis="Y")
    assert np.allclose(straight.position[:, 1], 1.0 - straight.uv[:, 1])


def test_vectors_without_length_are_replaced_by_unit_vectors():
    bare = two_quads((0.0, 0.5, 1.0))
    bare.normals[:] = 0.0
    bare.tangents[..., :3] = 0.0
    made = vertices(bare, up_axis="Y")
    assert np.allclose(made.normal, (0.0, 0.0, 1.0))
    assert np.allclose(np.linalg.norm(made.tangent[:, :3], axis=1), 1.0)
    assert np.allclose((made.tangent[:, :3] * made.normal).sum(axis=1), 0.0)


def test_each_tile_becomes_a_part_in_the_first_tile():
    corners = two_quads((0.0, 1.0, 2.0))
    found = {tile: part for _, tile, part in parts(corners, udim=True)}
    assert sorted(found) == [1001, 1002]
    assert all(0.0 <= part.uv.min() and part.uv.max() <= 1.0 for part in found.values())
    (whole,) = parts(corners, udim=False)
    assert len(whole[2].points) == 4
    assert whole[2].uv.max() == 2.0

"""One shape in four formats, without normals: smooth where it is smooth, and the same picture."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest

from fabricusd.quality.colors import delta_e_2000
from fabricusd.reference.defaults import default_lights
from fabricusd.reference.rays.triangles import P0, N, build_tables
from fabricusd.reference.render import render_scene
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import Camera
from tests.reference.scenes import looking
from tests.scene.files.mesh_files import Gltf, ply

AROUND, UP = 64, 32
ROUND = 2 * np.pi * np.arange(AROUND + 1) / AROUND
SLOPE = np.array([0.2, 0.1]) / np.hypot(0.2, 0.1)
"""Of a cone 0.2 high on a base of radius 0.1: along y, and outwards."""


def _turned(radius, height):
    """(UP + 1, AROUND + 1, 3) a profile turned about y; the seam's points are there twice."""
    x, z = np.outer(radius, np.sin(ROUND)), np.outer(radius, np.cos(ROUND))
    return np.stack([x, np.broadcast_to(np.asarray(height)[:, None], x.shape), z], axis=-1)


def _side(grid):
    """Points, UVs and quads of a grid of points, its front outside."""
    rows, columns = grid.shape[:2]
    v, u = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    at = np.arange(rows * columns).reshape(rows, columns)
    quads = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1)
    uv = np.stack([u, v], axis=-1).reshape(-1, 2)
    return grid.reshape(-1, 3), uv, [list(map(int, q)) for q in quads.reshape(-1, 4)]


def _with_caps(side, *heights):
    """The side closed by one polygon at each of the heights (y, facing)."""
    points, uv, faces = side
    for y, facing in heights:
        ring = _turned(np.array([0.1]), [y])[0, :-1]
        start = len(points)
        points = np.concatenate([points, ring])
        uv = np.concatenate([uv, 0.5 + 5 * ring[:, [0, 2]]])
        face = list(range(start, start + len(ring)))
        faces = [*faces, face if facing > 0 else face[::-1]]
    return points, uv, faces


def _sphere():
    angle = np.linspace(-np.pi / 2, np.pi / 2, UP + 1)
    points, uv, quads = _side(_turned(0.1 * np.cos(angle), 0.1 * np.sin(angle)))
    # At the poles a quad is a triangle.
    row = AROUND + 1
    faces = [[a, c, d] if a < row else [a, b, d] if d >= UP * row else [a, b, c, d]
             for a, b, c, d in quads]  # fmt: skip
    return points, uv, faces


def _torus():
    angle = np.linspace(0, 2 * np.pi, UP + 1)
    return _side(_turned(0.1 + 0.04 * np.cos(angle), 0.04 * np.sin(angle)))


def _cylinder():
    return _with_caps(
        _side(_turned(np.full(UP + 1, 0.1), np.linspace(0, 0.2, UP + 1))), (0.2, 1), (0, -1)
    )


def _cone():
    height = np.linspace(0, 0.2, UP + 1)
    points, uv, quads = _side(_turned(0.1 * (1 - height / 0.2), height))
    tip = UP * (AROUND + 1)
    faces = [[a, b, d] if d >= tip else [a, b, c, d] for a, b, c, d in quads]
    return _with_caps((points, uv, faces), (0, -1))


SHAPES = {"sphere": _sphere, "cylinder": _cylinder, "cone": _cone, "torus": _torus}
FORMATS = ("obj", "ply", "glb", "usda")


def _wanted(shape, points, face):
    """(n, 3) analytic normals at corners, and which of them are away from poles.

    face : (n, 3) normals of their triangles, which tell a cap from a side
    """
    out = points * (1, 0, 1)
    radius = np.linalg.norm(out, axis=1, keepdims=True)
    away = radius[:, 0] > 0.03
    out = out / np.maximum(radius, 1e-9)
    if shape == "sphere":
        return points / np.linalg.norm(points, axis=1, keepdims=True), away
    if shape == "torus":
        normals = points - 0.1 * out
        return normals / np.linalg.norm(normals, axis=1, keepdims=True), away
    side = out if shape == "cylinder" else SLOPE[0] * out + SLOPE[1] * np.array([0, 1, 0])
    flat = np.abs(face[:, 1:2]) > 0.9
    return np.where(flat, np.sign(face) * np.array([0, 1, 0]), side), away | flat[:, 0]


def _write(folder, shape):
    """The shape as a file of each format."""
    points, uv, faces = SHAPES[shape]()
    path = folder / f"{shape}.obj"
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points]
    lines += [f"vt {u:.9g} {v:.9g}" for u, v in uv]
    lines += ["f " + " ".join(f"{k + 1}/{k + 1}" for k in face) for face in faces]
    path.write_text("\n".join(lines))
    path.with_suffix(".ply").write_bytes(
        ply("binary_little_endian", np.column_stack([points, uv]), faces, "x y z s t")
    )
    made = Gltf()
    fans = [[face[0], b, c] for face in faces for b, c in pairwise(face[1:])]
    place = {
        "POSITION": made.add(points.astype("f4")),
        "TEXCOORD_0": made.add((uv * (1, -1) + (0, 1)).astype("f4")),
    }
    made.node(
        name=shape,
        mesh=made.mesh({"attributes": place, "indices": made.add(np.ravel(fans).astype("u4"))}),
    )
    path.with_suffix(".glb").write_bytes(made.glb())
    corners = ", ".join(str(k) for face in faces for k in face)
    path.with_suffix(".usda").write_text(
        f"""#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
)
def Mesh "{shape}"
{{
    point3f[] points = [{", ".join(f"({x:.9g}, {y:.9g}, {z:.9g})" for x, y, z in points)}]
    int[] faceVertexCounts = [{", ".join(str(len(face)) for face in faces)}]
    int[] faceVertexIndices = [{corners}]
    texCoord2f[] primvars:st = [{", ".join(f"({u:.9g}, {v:.9g})" for u, v in uv)}] (
        interpolation = "vertex"
    )
    uniform token subdivisionScheme = "none"
}}
"""
    )


def _read(folder, shape, suffix):
    scene = read_scene(folder / f"{shape}.{suffix}", fabric="linen_plain")
    assert scene.meshes[0].normals is None
    return scene


@pytest.mark.parametrize("shape", SHAPES)
def test_a_round_shape_is_round_in_every_format(tmp_path, shape):
    _write(tmp_path, shape)
    for suffix in FORMATS:
        tables = build_tables(_read(tmp_path, shape, suffix))
        records = tables.records.astype(float)
        corners = np.stack(
            [records[:, P0 : P0 + 3] + records[:, e : e + 3] * (e > 0) for e in (0, 3, 6)], axis=1
        )
        face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        face /= np.linalg.norm(face, axis=1, keepdims=True)
        wanted, away = _wanted(
            shape, (corners + tables.centre).reshape(-1, 3), np.repeat(face, 3, axis=0)
        )
        found = records[:, N : N + 9].reshape(-1, 3)
        off = np.degrees(np.arccos(np.clip(np.einsum("ni,ni->n", wanted, found), -1, 1)))
        assert off[away].max() < 1, suffix
        assert away.mean() > 0.6


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_is_the_same_picture_from_every_format(tmp_path, shape):
    _write(tmp_path, shape)
    pictures = {}
    for suffix in FORMATS:
        scene = _read(tmp_path, shape, suffix)
        scene.camera = Camera(frame=looking((0.2, 0.35, 0.5), (0, 0.08, 0)), focal_length=0.06)
        scene.lights = default_lights(scene)
        result = render_scene(scene, width=64, height=64, spp=16, level="far", shadow="none")
        assert result.met
        pictures[suffix] = result.layers["beauty"][..., :3].astype(float)
    for one, other in combinations(FORMATS, 2):
        difference = delta_e_2000(pictures[one], pictures[other])
        assert difference.mean() <= 0.3, (one, other)
    # The comparison would see a picture that is another one.
    assert delta_e_2000(pictures["obj"], pictures["ply"][::-1]).mean() > 2

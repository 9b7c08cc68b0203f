"""Which meshes share a garment: true copies alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fabricusd.bake.layout.copies import are_copies, topology
from fabricusd.bake.layout.garment import garments
from fabricusd.fabric import Binding, Fabric
from fabricusd.scene.scene import FabricSurface, Mesh, Scene

TURN = Rotation.from_euler("xyz", (0.4, -1.1, 2.3)).as_matrix()
MIRROR = np.diag((1.0, 1.0, -1.0))


def wavy(points: np.ndarray | None = None) -> Mesh:
    """A bent grid of 5 x 5 points."""
    x, y = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5), indexing="ij")
    i = np.arange(25).reshape(5, 5)
    a, b, c, d = (k.ravel() for k in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    tri = np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1)))
    if points is None:
        points = np.stack((x, y, 0.3 * np.sin(5 * x) * np.cos(3 * y)), axis=-1).reshape(-1, 3)
    uv = np.stack((x, y), axis=-1).reshape(-1, 2)
    return Mesh(
        path="/Wavy", points=points, triangles=tri, uv=uv[tri],
        material=np.zeros(len(tri), np.int32),
    )  # fmt: skip


def sheared() -> tuple[Mesh, Mesh]:
    """Two meshes of which each triangle's first edge has one length, and the shapes differ: the
    first edges all run along x, and y is squeezed."""
    one = wavy()
    tri = one.triangles.copy()
    x = one.points[:, 0]
    # Turn each triangle until its first edge runs along x alone.
    for k, t in enumerate(tri):
        for turn in range(3):
            a, b, _ = np.roll(t, -turn)
            if one.points[a, 1] == one.points[b, 1]:
                tri[k] = np.roll(t, -turn)
    flat = np.stack((x, one.points[:, 1], np.zeros(25)), axis=1)
    first = replace(one, points=flat, triangles=tri)
    return first, replace(first, points=flat * (1.0, 0.5, 1.0))


def moved(mesh: Mesh, turn: np.ndarray, by: float = 0.0) -> Mesh:
    return replace(mesh, path="/Other", points=mesh.points @ turn.T + by)


@pytest.mark.parametrize("by", [0.0, 3.0, 1e4])
@pytest.mark.parametrize("turn", [np.eye(3), TURN])
def test_what_was_moved_and_turned_is_a_copy(turn, by):
    one = wavy()
    other = moved(one, turn, by)
    assert topology(one) == topology(other)
    assert are_copies(one, other)


def test_a_copy_in_single_precision_is_one():
    one = wavy()
    other = moved(one, TURN, 1.0)
    assert are_copies(one, replace(other, points=other.points.astype(np.float32).astype(float)))


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("mirrored", moved(wavy(), MIRROR)),
        ("scaled", moved(wavy(), 2.0 * np.eye(3))),
        ("bent the other way", wavy(wavy().points * (1, 1, -1) + (0, 0, 1e-3))),
        ("one point off", wavy(wavy().points + np.eye(25, 3, -12) * 1e-4)),
        ("not finite", wavy(np.full((25, 3), np.nan))),
    ],
)
def test_what_has_another_shape_is_none(name, other):
    assert not are_copies(wavy(), other), name


def test_one_edge_a_triangle_does_not_tell_meshes_apart():
    first, second = sheared()
    edges = [m.points[m.triangles[:, 1]] - m.points[m.triangles[:, 0]] for m in (first, second)]
    lengths = [np.linalg.norm(e, axis=1) for e in edges]
    assert np.allclose(*lengths)
    assert topology(first) == topology(second)
    assert not are_copies(first, second)
    surface = FabricSurface(binding=Binding(fabric=Fabric(), threads_per_uv=(8.0, 8.0)))
    scene = Scene(meshes=[first, replace(second, path="/Squeezed")], materials=[surface])
    assert len(garments(scene)) == 2


def test_all_three_edges_do_not_either_where_a_fold_may_go_both_ways():
    """A strip folded up and the same strip folded down have the same triangles."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0.4, 1, 0.3], [0.4, -1, 0.5]], float)
    tri = np.array([[0, 1, 2], [1, 0, 3]])
    one = replace(
        wavy(points), triangles=tri, uv=points[:, :2][tri], material=np.zeros(2, np.int32)
    )
    # The second triangle is turned about the common edge, the x axis, by 180 - 2 * its tilt.
    other = points.copy()
    other[3] = (0.4, -1, -0.5)
    assert not are_copies(one, replace(one, points=other))


def test_a_turned_mesh_is_none_where_only_moved_ones_count():
    one = wavy()
    assert not are_copies(one, moved(one, TURN), turned=False)
    assert are_copies(one, moved(one, np.eye(3), 2.0), turned=False)


def test_authored_normals_turn_along_or_make_another_mesh():
    one = wavy()
    normals = np.random.default_rng(0).normal(size=(len(one.triangles), 3, 3))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    authored = replace(one, normals=normals)
    assert topology(authored) != topology(one)
    other = replace(moved(one, TURN), normals=normals @ TURN.T)
    assert are_copies(authored, other)
    assert not are_copies(authored, replace(other, normals=-normals @ TURN.T))


def test_points_that_no_triangle_has_do_not_count():
    one = wavy()
    more = replace(one, points=np.concatenate((one.points, [[9.0, 9.0, 9.0]])))
    other = replace(one, points=np.concatenate((one.points, [[-5.0, 0.0, 2.0]])))
    assert are_copies(more, other)

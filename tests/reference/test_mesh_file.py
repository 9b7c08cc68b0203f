"""OBJ, GLB and PLY files as scenes."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from fabricusd.errors import FabricError
from fabricusd.reference.read import read_scene

OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n"


def test_a_node_that_mirrors_keeps_its_front_and_its_uvs(tmp_path):
    shape = trimesh.Trimesh(
        [[0, 0, 0], [1, 0, 0], [1, 0, -1]], [[0, 1, 2]], process=False,
        visual=trimesh.visual.TextureVisuals(uv=[[0, 0], [1, 0], [1, 1]]),
    )  # fmt: skip
    whole = trimesh.Scene()
    whole.add_geometry(shape, node_name="plain")
    whole.add_geometry(shape, node_name="mirrored", transform=np.diag([-1.0, 1, 1, 1]))
    whole.export(tmp_path / "x.glb")
    meshes = read_scene(tmp_path / "x.glb", fabric="linen_plain").meshes
    assert len(meshes) == 2
    for mesh in meshes:
        a, b, c = mesh.points[mesh.triangles[0]]
        assert np.cross(b - a, c - a)[1] == pytest.approx(1)
        for point, uv in zip((a, b, c), mesh.uv[0], strict=True):
            assert uv == pytest.approx([abs(point[0]), -point[2]])


def test_letters_of_another_encoding_are_no_reason_to_refuse_an_obj(tmp_path):
    (tmp_path / "x.obj").write_bytes(b"# Gr\xf6\xdfe\ng T\xfcll\n" + OBJ.encode())
    assert len(read_scene(tmp_path / "x.obj", fabric="linen_plain").meshes) == 1


def test_a_mesh_file_without_a_fabric_says_that_it_is_grey(tmp_path):
    (tmp_path / "x.obj").write_text(OBJ)
    assert read_scene(tmp_path / "x.obj").notes == [
        "x.obj is rendered grey: no fabric is named for it"
    ]


def test_a_mesh_file_has_no_cameras(tmp_path):
    (tmp_path / "x.obj").write_text(OBJ)
    with pytest.raises(FabricError, match=r":/c is no camera; .obj files have none"):
        read_scene(tmp_path / "x.obj", camera="/c")

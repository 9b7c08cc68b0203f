"""OBJ files are read as they say: indices, polygons, pieces, UVs, normals; and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.scene.files.obj import read_obj
from fabricusd.scene.read import read_scene
from tests.scene.files.mesh_files import CASES, area, bounds, uv_area

QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
FULL = "f 1/1 2/2 3/3 4/4\n"

# case: {mesh: (area, UV area or None)}
SHARED = {
    "obj_interleaved_negative/two_panels.obj": {"": (0.04, 1.0)},
    "obj_interleaved_negative/absolute.obj": {"": (0.04, 1.0)},
    "obj_concave_polygon/ell.obj": {"": (0.04, 0.04)},
    "obj_objects_sharing_material/three.obj": {
        "Front": (0.01, 1.0), "Back": (0.01, 1.0), "Sleeve": (0.01, 1.0),
    },
    "obj_objects_sharing_material/groups.obj": {
        "Pattern 2D Front": (0.02, 0.02), "Pattern 2D Back": (0.02, 0.02),
        "Trim no uv": (0.02, None),
    },
}  # fmt: skip


def read(tmp_path, text):
    path = tmp_path / "x.obj"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_obj(path)


@pytest.mark.parametrize("name", SHARED)
def test_pieces_have_the_areas_and_names_of_the_file(name):
    pieces = {one.name: one for one in read_obj(CASES / name).pieces}
    assert list(pieces) == list(SHARED[name])
    for piece, (solid, flat) in SHARED[name].items():
        assert area(pieces[piece]) == pytest.approx(solid)
        assert (pieces[piece].uv is None) == (flat is None)
        if flat is not None:
            assert uv_area(pieces[piece]) == pytest.approx(flat)


def test_relative_indices_count_from_their_line():
    for name in ("two_panels.obj", "absolute.obj"):
        [mesh] = read_scene(CASES / "obj_interleaved_negative" / name, fabric="linen_plain").meshes
        assert bounds(mesh) == [[0, 0, 0], [0.3, 0.2, 0]]
        left = mesh.points[mesh.triangles].mean(axis=1)[:, 0] < 0.15
        assert mesh.uv[left][..., 0].min() == 0
        assert mesh.uv[left][..., 0].max() == 0.5
        assert mesh.uv[~left][..., 0].min() == 0.5


def test_an_object_is_where_its_own_vertices_are():
    meshes = read_scene(CASES / "obj_objects_sharing_material/three.obj").meshes
    named = {mesh.path: bounds(mesh)[0][0] for mesh in meshes}
    assert named == {"three.obj:Front": 0, "three.obj:Back": 0.2, "three.obj:Sleeve": 0.4}


SPELLED = {
    # the way it is written: the same square of area 1 and UV area 1, in one piece of that name
    "plain": (QUAD + FULL, ""),
    "line ends of Windows": ((QUAD + FULL).replace("\n", "\r\n"), ""),
    "line ends of old Macs": ((QUAD + FULL).replace("\n", "\r"), ""),
    "no line end": (QUAD + FULL.strip(), ""),
    "a byte order mark": ("\ufeff" + QUAD + FULL, ""),
    "indented, with tabs": ((QUAD + FULL).replace("\n", "\n\t ").replace(" 0", "\t0"), ""),
    "a line that goes on": (QUAD + "f 1/1 2/2 \\\n3/3 \\\r\n 4/4\n", ""),
    "comments": (QUAD.replace("v 1 0 0", "v 1 0 0 # here") + "f 1/1 2/2 3/3 4/4# there\n", ""),
    "colours": (QUAD.replace("v 1 0 0", "v 1 0 0 .5 .5 .5"), ""),
    "weights": (QUAD.replace("v 1 0 0", "v 1 0 0 1").replace("vt 1 0", "vt 1 0 0"), ""),
    "exponents": (QUAD.replace("v 1 0 0", "v 1.e0 +0 -0E-2"), ""),
    "relative": (QUAD + "f -4/-4 -3/-3 -2/-2 -1/-1\n", ""),
    "vertices after their face": (FULL + QUAD, ""),
    "several materials": (
        QUAD + "o A\nusemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 3/3 4/4\n", "A",
    ),
    "an object taken up again": (
        QUAD + "o A\nf 1/1 2/2 3/3\no B\no A\nf 1/1 3/3 4/4\n", "A",
    ),
    "a group within an object": (QUAD + "o A\ng b\n" + FULL, "A.b"),
    "a group named as its object": (QUAD + "o A\ng A\n" + FULL, "A"),
    "a name of two words": (QUAD + "g  left  arm \n" + FULL, "left arm"),
    "a name in Latin-1": ((QUAD + "o Jäckchen\n" + FULL).encode("latin-1"), "Jäckchen"),
    "a name in UTF-8": (QUAD + "o 袖\n" + FULL, "袖"),
    "unknown lines": ("mtllib no such.mtl\ns off\nxyzzy 1 2\nv\u00a0 1\n" + QUAD + FULL, ""),
}  # fmt: skip


@pytest.mark.parametrize("name", SPELLED)
def test_a_square_is_a_square_however_it_is_written(tmp_path, name):
    text, piece = SPELLED[name]
    whole = text.encode() if isinstance(text, str) else text
    if b"f " not in whole:
        whole += FULL.encode()
    [one] = read(tmp_path, whole).pieces
    assert one.name == piece
    assert area(one) == pytest.approx(1)
    assert uv_area(one) == pytest.approx(1)
    assert np.allclose(one.points[one.triangles][..., :2], one.uv)


REFUSED = {
    # what is wrong: (text, words of the one line)
    "a point beyond the last": (QUAD + "f 1 2 5", "x.obj:9 has the corner '5' with v 5; there a"),
    "a UV beyond the last": (
        QUAD + "\n" + "f 1/1 2/2 3/9", "x.obj:10 has the corner '3/9' with vt 9; there are 4 vt",
    ),
    "a normal where there is none": (QUAD + "f 1//1 2//1 3//1", "1//1' with vn 1; there are 0 vn"),
    "back beyond the first": (
        "v 0 0 0\nf -1 -2 -3\n" + QUAD, "x.obj:2 has the corner '-2' with v -2; there are 1 v line",
    ),
    "a UV back beyond the first": (
        "vt 0 0\n" + QUAD + "f 1/-1 2/-6 3/-1", "'2/-6' with vt -6; there are 5 vt lines before it",
    ),
    "an index of 0": (QUAD + "f 0 1 2", "x.obj:9 has the corner '0'; it must look like 7, 7/3"),
    "a UV index of 0": (QUAD + "f 1/0 2/1 3/1", "the corner '1/0'"),
    "a word for an index": (QUAD + "f 1 2 x", "the corner 'x'"),
    "two numbers in one": (QUAD + "f 1 2 3-4", "the corner '3-4'"),
    "a fraction": (QUAD + "f 1 2 3.5", "the corner '3.5'"),
    "four numbers in a corner": (QUAD + "f 1/1/1/1 2 3", "the corner '1/1/1/1'"),
    "a corner without a point": (QUAD + "f /1 2/2 3/3", "the corner '/1'"),
    "an index beyond 64 bits": (QUAD + "f 1 2 99999999999999999999", "the corner '9999999"),
    "an index that 64 bits wrap": (QUAD + "f 18446744073709551617 2 3", "the corner '18446"),
    "an index back beyond 64 bits": (QUAD + "f -99999999999999999999 2 3", "the corner '-99999"),
    "two coordinates": ("v 0 0\n" + QUAD + FULL, "x.obj:1 has 2 numbers; v needs at least 3"),
    "no coordinate": (QUAD + "vt\n" + FULL, "x.obj:9 has 0 numbers; vt needs at least 1"),
    "a comma": (QUAD + "v 1,5 0 0\n" + FULL, "x.obj:9 has '1,5'; v takes numbers"),
    "a hexadecimal number": (QUAD + "vn 0x1 0 0\n" + FULL, "has '0x1'; vn takes numbers"),
    "a line after one that goes on": (
        QUAD + "f 1 2 \\\n 3\nf 1 2 7", "x.obj:11 has the corner '7'",
    ),
    "nothing": ("# nothing\n", "holds no triangles"),
    "points alone": (QUAD, "holds no triangles"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_wrong_is_refused_with_its_line_and_value(tmp_path, name):
    text, words = REFUSED[name]
    path = tmp_path / "x.obj"
    path.write_text(text)
    with pytest.raises(FabricError) as caught:
        read_scene(path, fabric="linen_plain")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_broken_files_end_in_one_line_or_are_read():
    with pytest.raises(FabricError, match=r"obj_vertexdim.obj:5 has 2 numbers"):
        read_obj(CASES / "hostile/obj_vertexdim.obj")
    with pytest.raises(FabricError, match=r"outofrange.obj:12 has the corner '9/9'"):
        read_obj(CASES / "obj_face_without_vt/outofrange.obj")
    # A `vt` of one number is a place at v = 0.
    [one] = read_obj(CASES / "hostile/obj_uv1.obj").pieces
    assert one.uv[0].tolist() == [[0, 0], [1, 0], [0, 1]]
    [one] = read_obj(CASES / "hostile/obj_novert.obj").pieces
    assert one.uv[0].tolist() == [[1, 0], [1, 0], [0, 1]]


def test_faces_without_uvs_lose_the_fabric_alone():
    scene = read_scene(CASES / "obj_face_without_vt/mixed.obj", fabric="linen_plain")
    [mesh] = scene.meshes
    assert mesh.material.tolist() == [1, 1, 0, 0]
    assert "mixed.obj has no UVs on 2 of 4 triangles; they are rendered grey" in scene.notes
    assert uv_area(mesh) == pytest.approx(1)


def test_lines_and_small_faces_are_noted(tmp_path):
    said = [
        problem
        for _, problem in read(tmp_path, QUAD + "l 1 2\nsurf 0 1\nl 2 3\np 1\nf 1 2\n").notes
    ]
    assert said == [
        "has 2 lines, left out",
        "has 1 free-form surfaces, left out",
        "has 1 points, left out",
        "has 1 faces below three corners, left out",
    ]


def test_file_normals_are_used_and_faces_without_are_smoothed(tmp_path):
    text = (
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 1\nv 2 1 1\nvn 0 .6 .8\nvn 0 0 -3\n"
        "f 1//1 2//1 3//1 4//1\nf 2 5 6 3\n"
    )
    path = tmp_path / "x.obj"
    path.write_text(text)
    [mesh] = read_scene(path).meshes
    assert mesh.normals[:2].reshape(-1, 3) == pytest.approx(np.tile([0, 0.6, 0.8], (6, 1)))
    # The second face shares an edge with the first one, 45 degrees from it.
    tilted = np.array([-1, 0, 1]) / np.sqrt(2)
    assert np.linalg.norm(mesh.normals[2:], axis=2) == pytest.approx(1)
    assert (mesh.normals[2:] @ tilted > np.cos(np.radians(46))).all()
    assert (mesh.normals[2:] @ tilted < 0.999).any()


def test_normals_against_the_winding_are_turned_with_a_note(tmp_path):
    path = tmp_path / "x.obj"
    path.write_text(QUAD + "vn 0 0 -3\nf 1//1 2//1 3//1\n")
    scene = read_scene(path)
    assert scene.meshes[0].normals.reshape(-1, 3).tolist() == [[0, 0, 1]] * 3
    assert any("point behind its faces on 1 of 1 triangles" in note for note in scene.notes)


def test_a_thousand_groups_are_a_thousand_meshes_of_their_own_points(tmp_path):
    text = "".join(
        f"g piece{k}\nv {k} 0 0\nv {k} 1 0\nv {k} 0 1\nf -3 -2 -1\n" for k in range(1000)
    )
    pieces = read(tmp_path, text).pieces
    assert [one.name for one in pieces] == [f"piece{k}" for k in range(1000)]
    assert all(one.points.tolist() == [[k, 0, 0], [k, 1, 0], [k, 0, 1]] for k, one in
               enumerate(pieces))  # fmt: skip


def test_blocks_of_lines_meet_without_a_seam(tmp_path, monkeypatch):
    monkeypatch.setattr("fabricusd.scene.files.obj.BYTES_AT_ONCE", 40)
    text = QUAD + FULL + "f -4/-4 -3/-3 -2/-2\n" * 9
    [small] = read(tmp_path, text).pieces
    monkeypatch.undo()
    [large] = read(tmp_path, text).pieces
    assert np.array_equal(small.triangles, large.triangles)
    assert np.array_equal(small.uv, large.uv)
    assert len(large.triangles) == 11

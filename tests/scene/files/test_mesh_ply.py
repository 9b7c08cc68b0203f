"""PLY files are read as they say, in each of their three forms; and what is refused."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.scene.files.ply import read_ply
from fabricusd.scene.read import read_scene
from tests.scene.files.mesh_files import area, ply, ply_header, uv_area

FORMS = ["ascii", "binary_little_endian", "binary_big_endian"]
SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
ELL = [(0, 0), (0.2, 0), (0.2, 0.1), (0.1, 0.1), (0.1, 0.3), (0, 0.3)]
ARROW = [(0.5, 1), (0, 0), (2, 1), (0, 2)]


def read(tmp_path, content):
    path = tmp_path / "x.ply"
    path.write_bytes(content)
    return read_ply(path)


FACES = {
    # faces of points in a plane: (points, faces, area)
    "triangles": (SQUARE, [[0, 1, 2], [0, 2, 3]], 1.0),
    "a quad": (SQUARE, [[0, 1, 2, 3]], 1.0),
    "sizes mixed": ([*SQUARE, [2, 0, 0]], [[0, 1, 2, 3], [1, 4, 2]], 1.5),
    "a concave polygon": ([[*p, 0] for p in ELL], [[0, 1, 2, 3, 4, 5]], 0.04),
    "an arrowhead": ([[*p, 0] for p in ARROW], [[0, 1, 2, 3]], 1.5),
    "a face of two corners": (SQUARE, [[0, 1], [0, 1, 2, 3]], 1.0),
    "a face of no corners": (SQUARE, [[0, 1, 2, 3], []], 1.0),
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", FACES)
def test_faces_of_any_size_keep_their_area(tmp_path, name, form):
    points, faces, size = FACES[name]
    found = read(tmp_path, ply(form, points, faces))
    [one] = found.pieces
    assert area(one) == pytest.approx(size)
    small = sum(len(face) < 3 for face in faces)
    assert len(found.notes) == (1 if small else 0)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("names", ["s t", "u v", "texture_u texture_v", "texture_s texture_t"])
def test_vertices_have_uvs_and_normals(tmp_path, names, form):
    rows = [[*p, p[0], p[1], 0, 0.6, 0.8] for p in SQUARE]
    [one] = read(tmp_path, ply(form, rows, [[0, 1, 2, 3]], f"x y z {names} nx ny nz")).pieces
    assert uv_area(one) == pytest.approx(1)
    assert one.points[one.triangles][..., :2] == pytest.approx(one.uv)
    assert one.normals.reshape(-1, 3) == pytest.approx(np.tile([0, 0.6, 0.8], (6, 1)))


@pytest.mark.parametrize("form", FORMS)
def test_corners_have_uvs_of_their_own(tmp_path, form):
    head = ply_header(
        form,
        {
            "vertex": (4, ["double x", "double y", "double z", "uchar red"]),
            "face": (
                3,
                ["float quality", "list uchar uint vertex_index", "list int double texcoord",
                 "int texnumber"],
            ),
        },
    )  # fmt: skip
    faces = [([0, 1, 2], [0, 0, 1, 0, 1, 1]), ([0, 2, 3], [0, 0, 1, 1, 0, 1]), ([0, 1, 3], [])]
    if form == "ascii":
        lines = [" ".join(map(str, [*p, 7])) for p in SQUARE]
        lines += [" ".join(map(str, [0.5, len(f), *f, len(t), *t, 0])) for f, t in faces]
        content = head + "\r\n".join(lines).encode()
    else:
        order = "<" if "little" in form else ">"
        content = head + b"".join(struct.pack(f"{order}3dB", *p, 7) for p in SQUARE)
        for f, t in faces:
            content += struct.pack(f"{order}fB3Ii{len(t)}di", 0.5, 3, *f, len(t), *t, 0)
    [one] = read(tmp_path, content).pieces
    assert one.textured.tolist() == [True, True, False]
    assert uv_area(one) == pytest.approx(1)
    path = tmp_path / "x.ply"
    scene = read_scene(path, fabric="linen_plain")
    assert scene.meshes[0].material.tolist() == [1, 1, 0]
    assert "x.ply has no UVs on 1 of 3 triangles; they are rendered grey" in scene.notes


@pytest.mark.parametrize("form", FORMS)
def test_strips_are_triangles_that_face_one_way(tmp_path, form):
    strip = [0, 1, 3, 2, -1, 0, 1, 3, 3, 1]
    head = ply_header(
        form,
        {
            "vertex": (4, ["float x", "float y", "float z"]),
            "tristrips": (1, ["list int int vertex_indices"]),
        },
    )
    if form == "ascii":
        lines = [*(" ".join(map(str, p)) for p in SQUARE), " ".join(map(str, [10, *strip]))]
        content = head + "\n".join(lines).encode()
    else:
        order = "<" if "little" in form else ">"
        content = head + np.array(SQUARE, f"{order}f4").tobytes()
        content += struct.pack(f"{order}11i", 10, *strip)
    [one] = read(tmp_path, content).pieces
    assert len(one.triangles) == 3
    a, b, c = (one.points[one.triangles[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


@pytest.mark.parametrize("form", FORMS)
def test_other_elements_are_passed_over(tmp_path, form):
    head = ply_header(
        form,
        {
            "camera": (2, ["uchar kind", "list uchar short things"]),
            "nothing": (5, []),
            "vertex": (4, ["short x", "short y", "short z"]),
            "face": (1, ["list uchar uchar vertex_indices"]),
            "edge": (1, ["int a", "int b"]),
        },
    )
    if form == "ascii":
        lines = [
            "1 0",
            "",
            "2 3 7 7 7",
            *(" ".join(map(str, p)) for p in SQUARE),
            "4 0 1 2 3",
            "0 1",
        ]
        content = head + "\n".join(lines).encode()
    else:
        order = "<" if "little" in form else ">"
        content = head + struct.pack(f"{order}BBBB3h", 1, 0, 2, 3, 7, 7, 7)
        content += np.array(SQUARE, f"{order}i2").tobytes() + bytes([4, 0, 1, 2, 3])
    [one] = read(tmp_path, content).pieces
    assert area(one) == pytest.approx(1)


def _text(vertices=4, faces=1, rows="0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n", form="ascii"):
    return ply_header(
        form,
        {
            "vertex": (vertices, ["float x", "float y", "float z"]),
            "face": (faces, ["list uchar int vertex_indices"]),
        },
    ) + (rows.encode() if isinstance(rows, str) else rows)


ROWS = np.array(SQUARE, "<f4").tobytes()
LITTLE = "binary_little_endian"

REFUSED = {
    # what is wrong: (content, words)
    "more vertices than bytes": (
        _text(vertices=10**9), "1000000000 rows of 'vertex', which take at least 6000",
    ),
    "more faces than bytes": (_text(faces=10**17), "rows of 'face', which take"),
    "more vertices than lines": (_text(vertices=5, faces=0), "x.ply:15 has 5 numbers"),
    "more faces than lines": (_text(faces=2), "says it has 2 rows of 'face'"),
    "more in binary": (
        _text(10**15, 1, ROWS, LITTLE),
        "rows of 'vertex', which take at least 12000000000000000 bytes",
    ),
    "a list longer than its line": (
        _text(rows="0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2\n"), "x.ply:15 says that list 'vertex_ind",
    ),
    "a list shorter than its line": (
        _text(rows="0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 3\n"), "x.ply:15 has 5 numbers",
    ),
    "a negative list": (
        _text(rows="0 0 0\n1 0 0\n1 1 0\n0 1 0\n-3 0 1 2\n"), "has -3 values",
    ),
    "a list longer than the file": (
        _text(4, 1, ROWS + bytes([200, 0, 0, 0, 0]), LITTLE), "'face' 0 has 200 values",
    ),
    "cut short": (_text(4, 2, ROWS + struct.pack("<B3i", 3, 0, 1, 2) + b"\x03\0\0\0\0", LITTLE),
                  "'face' 1 has 3 values"),
    "a vertex that is none": (
        _text(rows="0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 9\n"), "face 0 with vertex 9; there are 4",
    ),
    "a vertex below 0": (
        _text(rows="0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 -1\n"), "face 0 with vertex -1",
    ),
    "half a vertex": (
        _text(rows="0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 1.5\n"), "face 0 with vertex 1.5",
    ),
    "a word": (_text(rows="0 0 0\n1 x 0\n1 1 0\n0 1 0\n3 0 1 2\n"), "x.ply:12 holds 'x'"),
    "two numbers in one": (_text(rows="0 0 0\n1 0-1 0\n1 1 0\n0 1 0\n3 0 1 2\n"), "holds '0-1'"),
    "a line of two numbers": (_text(rows="0 0 0\n1 0\n1 1 0\n0 1 0\n3 0 1 2\n"), "x.ply:12 has 2"),
    "a line of four": (_text(rows="0 0 0\n1 0 0 5\n1 1 0\n0 1 0\n3 0 1 2\n"), "x.ply:12 has 4"),
    "no format": (_text().replace(b"format ascii 1.0\n", b""), "has no format"),
    "a format that is none": (_text().replace(b"ascii", b"ebcdic"), "x.ply:2 says 'format ebcdic"),
    "a type that is none": (_text().replace(b"float x", b"quad x"), "'property quad x'"),
    "a list counted by fractions": (
        _text().replace(b"list uchar", b"list float"), "counts a list by 'float'",
    ),
    "a count that is a word": (_text().replace(b"vertex 4", b"vertex four"), "x.ply:4 says 'elem"),
    "a count of twenty digits": (_text(vertices=10**20), "x.ply:4 says 'element vertex 1000000"),
    "no end of the header": (_text().replace(b"end_header", b"header_end"), "have an end_header"),
    "another file": (b"polygon\nend_header\n", "must begin with 'ply'"),
    "no z": (_text().replace(b"float z", b"float w"), "has no vertices with x, y and z"),
    "nothing": (b"ply\n", "must begin with 'ply' and have an end_header"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_wrong_is_refused_in_one_line(tmp_path, name):
    content, words = REFUSED[name]
    with pytest.raises(FabricError, match=words) as caught:
        read(tmp_path, content)
    assert "\n" not in str(caught.value)


def test_points_alone_hold_no_triangles(tmp_path):
    path = tmp_path / "x.ply"
    path.write_bytes(_text(faces=0, rows="0 0 0\n1 0 0\n1 1 0\n0 1 0\n"))
    with pytest.raises(FabricError, match="holds no triangles"):
        read_scene(path)

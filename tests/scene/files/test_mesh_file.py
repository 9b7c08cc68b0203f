"""Mesh files as scenes: names, fabrics, units and sizes."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from fabricusd.errors import FabricError
from fabricusd.scene.files import mesh_file
from fabricusd.scene.read import read_scene
from fabricusd.scene.size import mesh_words
from tests.scene.files.mesh_files import CASES, Gltf, bounds, one_square, ply

OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n"
METRES = "; .obj files have no unit, and metres were assumed"


def test_a_file_of_another_program_is_read(tmp_path):
    shape = trimesh.Trimesh(
        [[0, 0, 0], [1, 0, 0], [1, 0, -1]], [[0, 1, 2]], process=False,
        visual=trimesh.visual.TextureVisuals(uv=[[0, 0], [1, 0], [1, 1]]),
    )  # fmt: skip
    whole = trimesh.Scene()
    whole.add_geometry(shape, node_name="plain")
    whole.add_geometry(shape, node_name="mirrored", transform=np.diag([-1.0, 1, 1, 1]))
    whole.export(tmp_path / "x.glb")
    meshes = read_scene(tmp_path / "x.glb", fabric="linen_plain").meshes
    assert [m.path for m in meshes] == ["x.glb:plain", "x.glb:mirrored"]
    for mesh in meshes:
        a, b, c = mesh.points[mesh.triangles[0]]
        assert np.cross(b - a, c - a)[1] == pytest.approx(1)
        for point, uv in zip((a, b, c), mesh.uv[0], strict=True):
            assert uv == pytest.approx([abs(point[0]), -point[2]])


def test_letters_of_another_encoding_are_no_reason_to_refuse_an_obj(tmp_path):
    (tmp_path / "x.obj").write_bytes(b"# Gr\xf6\xdfe\ng T\xfcll\n" + OBJ.encode())
    [mesh] = read_scene(tmp_path / "x.obj", fabric="linen_plain").meshes
    assert mesh.path == "x.obj:Tüll"


def test_a_mesh_file_without_a_fabric_says_that_it_is_grey(tmp_path):
    (tmp_path / "x.obj").write_text(OBJ)
    assert read_scene(tmp_path / "x.obj").notes == [
        "x.obj is rendered grey: no fabric was given for it",
        "x.obj is 1 m wide and 1 m high" + METRES,
    ]


def test_a_mesh_file_has_no_cameras(tmp_path):
    (tmp_path / "x.obj").write_text(OBJ)
    with pytest.raises(FabricError, match=r":/c is not a camera; .obj files have none"):
        read_scene(tmp_path / "x.obj", camera="/c")


@pytest.mark.parametrize(
    ("units", "metres"), [("m", 1), ("cm", 0.01), ("mm", 0.001), ("in", 0.0254)]
)
def test_units_are_what_the_numbers_are_in(tmp_path, units, metres):
    (tmp_path / "x.obj").write_text(OBJ)
    (tmp_path / "x.ply").write_bytes(ply("ascii", [[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 1, 2]]))
    for name in ("x.obj", "x.ply"):
        scene = read_scene(tmp_path / name, fabric="linen_plain", units=units)
        assert bounds(scene.meshes[0])[1] == pytest.approx([metres, metres, 0])
        assert not any("wide" in note for note in scene.notes if units != "mm")


def test_units_of_a_file_that_has_its_own_are_refused(tmp_path):
    (tmp_path / "x.glb").write_bytes(one_square().glb())
    (tmp_path / "x.usda").write_text("#usda 1.0\n")
    for name in ("x.glb", "x.usda"):
        with pytest.raises(FabricError, match=r"--units is for .obj and .ply files; a .\w+ file"):
            read_scene(tmp_path / name, units="cm")
    with pytest.raises(FabricError, match="--units is 'yd'; it must be one of m, cm, mm, in"):
        read_scene(CASES / "obj_centimetres/panel_cm.obj", units="yd")


def _sides(x, y, z=0.0):
    return f"v 0 0 0\nv {x} 0 0\nv {x} {y} {z}\nf 1 2 3\n"


SIZES = {
    # what is told of a file: (its lengths, --units, words; None for nothing)
    "a panel": (_sides(0.6, 0.8), None, "is 0.6 m wide and 0.8 m high" + METRES),
    "a garment": (
        _sides(0.6, 0.8, 0.25), None, "is 0.6 m wide, 0.8 m high and 0.25 m deep" + METRES,
    ),
    "a curtain": (_sides(9.9, 3), None, "is 9.9 m wide and 3 m high" + METRES),
    "centimetres": (
        _sides(60, 80), None,
        "is 60 m wide and 80 m high" + METRES + "; if it is in centimetres, add --units cm",
    ),
    "millimetres": (
        _sides(600, 800), None,
        "is 600 m wide and 800 m high" + METRES + "; if it is in millimetres, add --units mm",
    ),
    "centimetres, told": (_sides(60, 80), "cm", None),
    "metres, told": (_sides(0.6, 0.8), "m", None),
    "centimetres, told as metres": (
        _sides(60, 80), "m",
        "is 60 m wide and 80 m high with --units m; cloth is unlikely to be that size",
    ),
    "metres, told as millimetres": (
        _sides(0.6, 0.8), "mm",
        "is 0.0006 m wide and 0.0008 m high with --units mm; cloth is unlikely to be that size; "
        "scale the file",
    ),
    "a swatch": (_sides(0.005, 0.005), None, "is 0.005 m wide and 0.005 m high" + METRES),
    "too small": (
        _sides(0.004, 0), None,
        "is 0.004 m wide" + METRES + "; cloth is unlikely to be that size; scale the file",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SIZES)
def test_a_size_is_told_in_metres(tmp_path, name):
    text, units, words = SIZES[name]
    (tmp_path / "x.obj").write_text(text)
    notes = [n for n in read_scene(tmp_path / "x.obj", units=units).notes if "grey" not in n]
    assert notes == ([] if words is None else [f"x.obj {words}"])


def test_the_shirt_front_in_centimetres_is_a_warning_that_names_the_option():
    path = CASES / "obj_centimetres/panel_cm.obj"
    [note] = read_scene(path, fabric="silk_shot").notes
    assert note.startswith("panel_cm.obj is 60 m wide and 80 m high")
    assert note.endswith("add --units cm")
    assert read_scene(path, fabric="silk_shot", units="cm").notes == []


def test_a_gltf_of_60_m_is_told_so(tmp_path):
    (tmp_path / "x.glb").write_bytes(one_square(scale=[600, 600, 600]).glb())
    [note] = read_scene(tmp_path / "x.glb", fabric="linen_plain").notes
    assert note == (
        "x.glb is 60 m wide and 60 m high; lengths in glTF are metres; cloth is unlikely to be "
        "that size; scale the file"
    )


def test_threads_across_are_those_of_the_fabric():
    scene = read_scene(CASES / "obj_centimetres/panel_cm.obj", fabric="linen_plain", units="cm")
    cloth = scene.materials[1].binding.fabric
    warp, weft = 0.6 * cloth.warp.density, 0.8 * cloth.weft.density
    assert mesh_words(scene, scene.meshes[0]) == (
        f"0.6 m wide and 0.8 m high; {warp:.0f} warp and {weft:.0f} weft threads of linen_plain "
        "across"
    )


def test_points_too_far_to_trace_do_not_count(tmp_path):
    (tmp_path / "x.obj").write_text(
        OBJ + "v 1e30 0 0\nv nan 0 0\nf 1 2 4\nf 1 2 5\nf 1/1 2/2 3/3\n"
    )
    scene = read_scene(tmp_path / "x.obj", fabric="linen_plain")
    assert "x.obj has 1 points beyond 1e+09 m, which do not count" in scene.notes
    assert scene.bounds()[1].tolist() == [1, 1, 0]


def test_uvs_that_are_not_finite_are_noted(tmp_path):
    (tmp_path / "x.obj").write_text(OBJ.replace("vt 1 0", "vt 1 nan"))
    notes = read_scene(tmp_path / "x.obj", fabric="linen_plain").notes
    assert "x.obj has UVs that are not finite on 1 triangles; they count as 0" in notes


def test_a_fault_that_a_reader_did_not_foresee_names_the_file(tmp_path, monkeypatch):
    def broken(path):
        raise IndexError("index 9 is out\nof bounds")

    monkeypatch.setitem(mesh_file.READERS, ".obj", broken)
    (tmp_path / "x.obj").write_text(OBJ)
    with pytest.raises(
        FabricError, match=r"x.obj cannot be read as a mesh: IndexError: index 9 is out of bounds"
    ):
        read_scene(tmp_path / "x.obj")


def test_pieces_of_equal_names_are_told_apart(tmp_path):
    made = Gltf()
    mesh = made.mesh(made.square())
    made.node(name="a", mesh=mesh, children=[1])
    made.node(name="a", mesh=mesh, translation=[1, 0, 0])
    (tmp_path / "x.glb").write_bytes(made.glb())
    assert [m.path for m in read_scene(tmp_path / "x.glb").meshes] == ["x.glb:a", "x.glb:a_2"]

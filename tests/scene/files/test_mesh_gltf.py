"""glTF files are read as they say: accessors, nodes, skins; and refused by what they require."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.scene.files.gltf import read_gltf
from fabricusd.scene.read import read_scene
from tests.scene.files.mesh_files import (
    CASES,
    SQUARE,
    SQUARE_TRIANGLES,
    SQUARE_UV,
    Gltf,
    area,
    bounds,
    one_square,
    uv_area,
)

HALF = np.sqrt(0.5)


def read(tmp_path, made, name="x.glb"):
    path = tmp_path / name
    path.write_bytes(made if isinstance(made, bytes) else made.glb())
    return read_gltf(path)


@pytest.mark.parametrize(
    "name",
    ["glb_without_material/panel.glb", "glb_quantized/uv16.glb", "glb_quantized/pos16.glb"],
)
def test_a_panel_is_a_tenth_of_a_metre_and_wears_the_fabric(name):
    scene = read_scene(CASES / name, fabric="linen_plain")
    [mesh] = scene.meshes
    assert area(mesh) == pytest.approx(0.01, rel=1e-4)
    assert uv_area(mesh) == pytest.approx(1)
    assert mesh.material.tolist() == [1, 1]
    assert scene.notes == []


def test_primitives_are_named_by_node_and_material_each_time():
    for _ in range(2):
        meshes = read_scene(CASES / "glb_random_names/two_prims.glb").meshes
        assert [m.path for m in meshes] == ["two_prims.glb:Shirt_a", "two_prims.glb:Shirt_b"]


@pytest.mark.parametrize(
    ("file", "extension"),
    [
        ("draco.glb", "KHR_draco_mesh_compression"),
        ("meshopt.glb", "EXT_meshopt_compression"),
        ("instancing.glb", "EXT_mesh_gpu_instancing"),
    ],
)
def test_a_required_extension_that_is_not_read_is_named(file, extension):
    with pytest.raises(FabricError, match=f"{file} requires the extension {extension}"):
        read_scene(CASES / "glb_required_extension" / file)


LOOKS = [
    "KHR_texture_basisu", "KHR_texture_transform", "EXT_texture_webp", "MSFT_texture_dds",
    "KHR_materials_unlit", "KHR_materials_pbrSpecularGlossiness", "KHR_lights_punctual",
    "EXT_lights_image_based", "KHR_xmp_json_ld", "KHR_mesh_quantization",
]  # fmt: skip
SHAPES = [
    "KHR_node_visibility",
    "ACME_texturedGeometry",
    "FB_ngon_encoding",
    "KHR_gaussian_splat",
    "",
]


@pytest.mark.parametrize("extension", LOOKS)
def test_what_touches_only_looks_may_be_required(tmp_path, extension):
    made = one_square()
    made.root["extensionsRequired"] = [extension]
    assert len(read(tmp_path, made).pieces) == 1


@pytest.mark.parametrize("extension", SHAPES)
def test_what_is_unknown_may_not_be_required(tmp_path, extension):
    made = one_square()
    made.root["extensionsRequired"] = [extension]
    with pytest.raises(FabricError, match=f"requires the extension {extension}"):
        read(tmp_path, made)


def test_compression_that_is_not_required_is_refused_where_nothing_else_is_there(tmp_path):
    made = one_square()
    primitive = made.root["meshes"][0]["primitives"][0]
    primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}}
    assert area(read(tmp_path, made).pieces[0]) == pytest.approx(0.01)
    for accessor in made.root["accessors"]:
        del accessor["bufferView"]
    with pytest.raises(FabricError, match="needs KHR_draco_mesh_compression"):
        read(tmp_path, made)
    made = one_square()
    made.root["bufferViews"][0].update(
        buffer=1, extensions={"EXT_meshopt_compression": {"buffer": 0}}
    )
    text = made.glb()
    root = json.loads(text[20 : 20 + struct.unpack_from("<I", text, 12)[0]])
    root["buffers"].append({"byteLength": 48, "extensions": {"EXT_meshopt_compression": {}}})
    with pytest.raises(FabricError, match="needs EXT_meshopt_compression"):
        read(tmp_path, json.dumps(root).encode(), "x.gltf")


UVS = {
    # kind: the stored UVs of the square, and what the accessor says beside
    "floats": (SQUARE_UV, {}),
    "normalized bytes": ((SQUARE_UV * 255).astype("u1"), {"normalized": True}),
    "normalized shorts": ((SQUARE_UV * 65535).astype("u2"), {"normalized": True}),
    "normalized signed bytes": ((SQUARE_UV * 127).astype("i1"), {"normalized": True}),
    "normalized signed shorts": ((SQUARE_UV * 32767).astype("i2"), {"normalized": True}),
    "bytes as they are": (SQUARE_UV.astype("u1"), {}),
    "shorts as they are": (SQUARE_UV.astype("u2"), {"normalized": False}),
}


@pytest.mark.parametrize("kind", UVS)
def test_uvs_of_any_type_are_those_of_the_file(tmp_path, kind):
    stored, more = UVS[kind]
    made = one_square()
    made.root["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = made.add(stored, **more)
    [one] = read(tmp_path, made).pieces
    assert uv_area(one) == pytest.approx(1)
    assert one.uv[0].tolist() == [[0, 0], [1, 0], [1, 1]]


def test_the_most_negative_number_is_minus_one(tmp_path):
    made = one_square()
    stored = np.array([[-128, 0], [-127, 0], [127, 0], [0, 0]], "i1")
    made.root["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = made.add(
        stored, normalized=True
    )
    [one] = read(tmp_path, made).pieces
    assert one.uv[0][:, 0].tolist() == [-1, -1, 1]


def test_strides_offsets_and_sparse_values_are_followed(tmp_path):
    made = Gltf()
    rows = np.zeros(4, [("pad", "u1", 4), ("p", "<f4", 3), ("uv", "<f4", 2)])
    rows["p"], rows["uv"] = SQUARE, SQUARE_UV
    rows["p"][2] = 9
    view = made.view(b"\0" * 8 + rows.tobytes(), byteStride=24)
    places, new = made.view(np.array([2], "u1").tobytes()), made.view(SQUARE[2].tobytes())
    common = {"bufferView": view, "count": 4, "componentType": 5126}
    made.root["accessors"] += [
        {
            **common, "byteOffset": 12, "type": "VEC3",
            "sparse": {
                "count": 1, "indices": {"bufferView": places, "componentType": 5121},
                "values": {"bufferView": new},
            },
        },
        {**common, "byteOffset": 24, "type": "VEC2"},
    ]  # fmt: skip
    primitive = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2}
    made.add(SQUARE_TRIANGLES)
    made.node(name="Shirt", mesh=made.mesh(primitive))
    [one] = read(tmp_path, made).pieces
    assert area(one) == pytest.approx(0.01)
    assert uv_area(one) == pytest.approx(1)


def test_an_accessor_without_bytes_is_zeros_with_sparse_values(tmp_path):
    made = one_square()
    accessor = made.root["accessors"][0]
    view = accessor.pop("bufferView")
    accessor["sparse"] = {
        "count": 4,
        "indices": {"bufferView": made.view(bytes(range(4))), "componentType": 5121},
        "values": {"bufferView": view},
    }
    assert area(read(tmp_path, made).pieces[0]) == pytest.approx(0.01)
    accessor["count"] = 10**9
    with pytest.raises(
        FabricError, match=r"accessors\[0\].count is 1000000000, without a buffer view"
    ):
        read(tmp_path, made)


MODES = {
    # mode: (corners in its order, triangles)
    "a list": (4, [0, 1, 2, 0, 2, 3], 2),
    "a strip": (5, [0, 1, 3, 2], 2),
    "a strip sewn together": (5, [0, 1, 3, 3, 1, 1, 3, 2], 2),
    "a fan": (6, [0, 1, 2, 3], 2),
}


@pytest.mark.parametrize("name", MODES)
def test_strips_and_fans_are_triangles_that_face_one_way(tmp_path, name):
    mode, corners, triangles = MODES[name]
    made = one_square()
    primitive = made.root["meshes"][0]["primitives"][0]
    primitive.update(mode=mode, indices=made.add(np.array(corners, "u4")))
    [one] = read(tmp_path, made).pieces
    assert len(one.triangles) == triangles
    assert area(one) == pytest.approx(0.01)
    a, b, c = (one.points[one.triangles[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_points_and_lines_are_noted_and_triangles_need_no_indices(tmp_path):
    made = Gltf()
    bare = {"attributes": {"POSITION": made.add(SQUARE[[0, 1, 2, 0, 2, 3]])}}
    lines = {**bare, "mode": 1}
    points = {**bare, "mode": 0}
    made.node(mesh=made.mesh(bare, lines, points, {"attributes": {}}, name="Mixed"))
    found = read(tmp_path, made)
    [one] = found.pieces
    assert (one.name, one.uv) == ("Mixed", None)
    assert area(one) == pytest.approx(0.01)
    assert found.notes == [
        ("Mixed", "has lines, which have no surface, left out"),
        ("Mixed", "has points, which have no surface, left out"),
        ("Mixed", "has no POSITION in primitive 3, left out"),
    ]


def test_nodes_stand_below_their_parents(tmp_path):
    made = Gltf()
    mesh = made.mesh(made.square())
    made.node(name="root", children=[1], translation=[1, 0, 0], scale=[2, 2, 2])
    made.node(name="turned", children=[2], rotation=[0, 0, HALF, HALF])
    made.node(name="leaf", mesh=mesh, matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.5, 0, 0, 1])
    [one] = read(tmp_path, made).pieces
    # 0.5 to the right, turned by a quarter to the left, twice as large, 1 to the right.
    assert bounds(one) == [[0.8, 1, 0], [1, 1.2, 0]]


def test_a_node_that_mirrors_keeps_its_front_its_uvs_and_its_normals(tmp_path):
    made = Gltf()
    square = made.square()
    square["attributes"]["NORMAL"] = made.add(np.tile(np.array([[0, 0, 1]], "f4"), (4, 1)))
    mesh = made.mesh(square)
    made.root["scenes"][0]["nodes"] = [0, 1]
    made.node(name="plain", mesh=mesh)
    made.node(name="mirrored", mesh=mesh, scale=[-1, 1, 1])
    path = tmp_path / "x.glb"
    path.write_bytes(made.glb())
    scene = read_scene(path, fabric="linen_plain")
    assert scene.notes == []
    for mesh in scene.meshes:
        a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
        assert (np.cross(b - a, c - a)[:, 2] > 0).all()
        assert mesh.normals.reshape(-1, 3) == pytest.approx(np.tile([0, 0, 1], (6, 1)))
        place = np.abs(mesh.points[mesh.triangles][..., :2]) * 10
        assert mesh.uv == pytest.approx(place, abs=1e-6)


def test_normals_turn_with_a_scale_that_is_not_even(tmp_path):
    made = one_square(scale=[1, 1, 4], rotation=[HALF, 0, 0, HALF])
    tilted = np.tile(np.array([[0, 0.6, 0.8]], "f4"), (4, 1))
    made.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = made.add(tilted)
    [one] = read(tmp_path, made).pieces
    # Divided by the scale, then turned about x: y to z, z to -y.
    want = np.array([0, -0.2, 0.6])
    found = one.normals[0, 0] / np.linalg.norm(one.normals[0, 0])
    assert found == pytest.approx(want / np.linalg.norm(want), abs=1e-6)


def test_the_default_scene_is_drawn_or_the_first_or_every_root(tmp_path):
    made = Gltf()
    mesh = made.mesh(made.square())
    for name in ("a", "b", "c"):
        made.node(name=name, mesh=mesh)
    made.root["scenes"] = [{"nodes": [0]}, {"nodes": [1, 2]}]
    for scene, names in ((0, ["a"]), (1, ["b", "c"]), (None, ["a"])):
        made.root["scene"] = scene
        if scene is None:
            del made.root["scene"]
        assert [one.name for one in read(tmp_path, made).pieces] == names
    del made.root["scenes"]
    made.root["nodes"][0]["children"] = [1]
    assert [one.name for one in read(tmp_path, made).pieces] == ["a", "b", "c"]


def test_names_are_told_apart_in_the_order_of_the_file(tmp_path):
    made = Gltf()
    made.root["materials"] = [{"name": "Cotton"}, {}]
    mesh = made.mesh(
        made.square(material=0), made.square(material=0), made.square(material=1), made.square(),
        name="Coat",
    )  # fmt: skip
    alone = made.mesh(made.square())
    made.root["scenes"][0]["nodes"] = [0, 1, 2, 3]
    made.node(name="Shirt", mesh=mesh)
    made.node(mesh=mesh)
    made.node(mesh=alone)
    made.node(name="Shirt_Cotton", mesh=alone)
    assert [one.name for one in read(tmp_path, made).pieces] == [
        "Shirt_Cotton", "Shirt_Cotton_2", "Shirt_material_1", "Shirt_3",
        "Coat_Cotton", "Coat_Cotton_2", "Coat_material_1", "Coat_3", "node_2", "Shirt_Cotton_3",
    ]  # fmt: skip


def _skinned(weights, joints=None):
    made = one_square()
    attributes = made.root["meshes"][0]["primitives"][0]["attributes"]
    joints = np.array([[0, 1, 0, 0]] * 4, "u1") if joints is None else joints
    attributes["JOINTS_0"] = made.add(joints)
    attributes["WEIGHTS_0"] = made.add(np.asarray(weights, "f4"))
    # The mesh's own node stands elsewhere, which a skin does not heed.
    made.root["nodes"][0].update(skin=0, translation=[7, 7, 7])
    made.root["scenes"][0]["nodes"] = [0, 1]
    made.node(name="hip", translation=[0, 1, 0], children=[2])
    made.node(name="knee", translation=[0, 0.5, 0])
    inverse = np.tile(np.eye(4, dtype="f4"), (2, 1, 1))
    inverse[:, 3, :3] = [[0, -1, 0], [0, -1, 0]]
    made.root["skins"] = [{"joints": [1, 2], "inverseBindMatrices": made.add(inverse)}]
    return made


def test_a_skin_poses_its_mesh(tmp_path):
    # At rest the hip stands where it was bound, and the knee half a metre above.
    for weights, rise in (([1, 0, 0, 0], 0.0), ([0, 1, 0, 0], 0.5), ([0.5, 0.5, 0, 0], 0.25),
                          ([0.25, 0.25, 0, 0], 0.25), ([0, 0, 0, 0], 0.0)):  # fmt: skip
        [one] = read(tmp_path, _skinned([weights] * 4)).pieces
        assert bounds(one) == [[0, rise, 0], [0.1, 0.1 + rise, 0]]
    [one] = read(tmp_path, _skinned([[1, 0, 0, 0]] * 2 + [[0, 1, 0, 0]] * 2)).pieces
    assert bounds(one) == [[0, 0, 0], [0.1, 0.6, 0]]


def test_a_skin_turns_normals_and_may_mirror(tmp_path):
    made = _skinned([[1, 0, 0, 0]] * 4)
    attributes = made.root["meshes"][0]["primitives"][0]["attributes"]
    attributes["NORMAL"] = made.add(np.tile(np.array([[0, 0, 1]], "f4"), (4, 1)))
    made.root["nodes"][1].update(rotation=[0, HALF, 0, HALF], scale=[1, 1, -1])
    [one] = read(tmp_path, made).pieces
    a, b, c = (one.points[one.triangles[:, k]] for k in range(3))
    face = np.cross(b - a, c - a)
    assert np.abs(face[:, 0]) == pytest.approx(0.01)
    assert (np.einsum("mc,mkc->mk", face, one.normals) > 0).all()


def test_morph_targets_move_by_the_weights_of_the_file(tmp_path):
    made = one_square()
    up = made.add(np.tile(np.array([[0, 0, 1]], "f4"), (4, 1)))
    made.root["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": up}, {}]
    assert bounds(read(tmp_path, made).pieces[0])[0] == [0, 0, 0]
    made.root["meshes"][0]["weights"] = [0.5, 1]
    assert bounds(read(tmp_path, made).pieces[0])[0] == [0, 0, 0.5]
    made.root["nodes"][0]["weights"] = [0.25, 1]
    assert bounds(read(tmp_path, made).pieces[0])[0] == [0, 0, 0.25]


def test_gpu_instances_that_are_not_required_are_noted(tmp_path):
    made = one_square(extensions={"EXT_mesh_gpu_instancing": {"attributes": {}}})
    [(where, note)] = read(tmp_path, made).notes
    assert where == "Shirt"
    assert "drawn once" in note


def test_buffers_may_lie_in_the_text_or_beside_it(tmp_path):
    made = one_square()
    [one] = read(tmp_path, made.gltf(), "x.gltf").pieces
    assert area(one) == pytest.approx(0.01)
    text = made.gltf("my%20numbers.bin")
    with pytest.raises(FabricError, match=r"my numbers.bin is missing; .*x.gltf needs it"):
        read(tmp_path, text, "x.gltf")
    (tmp_path / "my numbers.bin").write_bytes(made.data)
    [one] = read(tmp_path, text, "x.gltf").pieces
    assert area(one) == pytest.approx(0.01)
    (tmp_path / "my numbers.bin").write_bytes(made.data[:50])
    with pytest.raises(FabricError, match=r"byteLength is 9\d; the buffer has 50 bytes"):
        read(tmp_path, text, "x.gltf")


def _changed(change):
    made = one_square()
    change(made.root)
    return made.glb()


def _primitive(root):
    return root["meshes"][0]["primitives"][0]


REFUSED = {
    # what is wrong: (change of the JSON, words)
    "a node below itself": (
        lambda r: r["nodes"][0].update(children=[0]), r"nodes\[0\] is named twice",
    ),
    "a node below two": (
        lambda r: (r["nodes"].append({}), r["nodes"][0].update(children=[1, 1])),
        r"nodes\[1\] is named twice",
    ),
    "a node that is none": (
        lambda r: r["nodes"][0].update(children=[5]), r"nodes\[0\].children is 5; the file has 1",
    ),
    "a mesh that is none": (
        lambda r: r["nodes"][0].update(mesh=1), r"nodes\[0\].mesh is 1; the file has 1",
    ),
    "a scene that is none": (lambda r: r.update(scene=4), "scene is 4; the file has 1 scenes"),
    "an accessor that is none": (
        lambda r: _primitive(r)["attributes"].update(TEXCOORD_0=9), "TEXCOORD_0 is 9; the file",
    ),
    "UVs fewer than points": (
        lambda r: r["accessors"][1].update(count=3), "TEXCOORD_0 has 3 values; POSITION has 4",
    ),
    "more values than bytes": (
        lambda r: r["accessors"][0].update(count=10**12), "takes 12000000000000 bytes",
    ),
    "a count below 0": (lambda r: r["accessors"][0].update(count=-1), "count is -1; it must be"),
    "a count that is a word": (lambda r: r["accessors"][0].update(count="4"), "count is '4'"),
    "a type that is none": (
        lambda r: r["accessors"][0].update(type="VEC9"), "type is 'VEC9'; .* must be VEC3",
    ),
    "a component that is none": (
        lambda r: r["accessors"][0].update(componentType=5124), "componentType is 5124",
    ),
    "indices as fractions": (
        lambda r: r["accessors"][2].update(componentType=5126, count=1), "indices must be 5121",
    ),
    "a view beyond its buffer": (
        lambda r: r["bufferViews"][0].update(byteLength=10**6), "ends at byte 1000000",
    ),
    "a matrix of three numbers": (
        lambda r: r["nodes"][0].update(matrix=[1, 0, 0]), "matrix holds 3 numbers; it must hold 16",
    ),
    "corners that make no triangles": (
        lambda r: r["accessors"][2].update(count=4), "holds 4 corners",
    ),
    "a mode that is none": (lambda r: _primitive(r).update(mode=7), "mode is 7"),
    "version 1": (lambda r: r["asset"].update(version="1.0"), "version is 1.0; it must be 2.0"),
    "a list for an object": (lambda r: r.update(nodes=[[]]), r"nodes\[0\] is a list"),
    "an object for a list": (lambda r: r.update(nodes={}), "nodes is an object; it must be a list"),
    "a skin that is none": (
        lambda r: (
            r["nodes"][0].update(skin=3),
            _primitive(r)["attributes"].update(JOINTS_0=3, WEIGHTS_0=3),
        ),
        "JOINTS_0 is 3",
    ),
    "a number beyond 64 bits": (
        lambda r: r["accessors"][0].update(count=10**40), "count is beyond 64 bits",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_wrong_is_refused_with_its_place_and_value(tmp_path, name):
    change, words = REFUSED[name]
    with pytest.raises(FabricError, match=words) as caught:
        read(tmp_path, _changed(change))
    assert str(caught.value).startswith(str(tmp_path / "x.glb"))


BROKEN = {
    "nothing but the magic": (b"glTF", "ends after 4 bytes"),
    "a container of version 1": (b"glTF" + bytes([1, 0, 0, 0]) + bytes(20), "version 1"),
    "cut short": (one_square().glb()[:200], "is cut short"),
    "no JSON chunk": (b"glTF" + struct.pack("<II", 2, 20) + bytes(8), "has no JSON chunk"),
    "no JSON": (b"no JSON", "its JSON"),
    "JSON that is a list": (b"[]", "must be an object"),
    "NaN": (b'{"asset": {"version": "2.0"}, "x": NaN}', "NaN is not a number in JSON"),
    "deep": (b"[" * 100000, "its JSON"),
    "not UTF-8": (b'{"asset": "\xff"}', "its JSON"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_container_is_refused(tmp_path, name):
    content, words = BROKEN[name]
    with pytest.raises(FabricError, match=words):
        read(tmp_path, content)


def test_an_index_beyond_the_points_names_the_primitive():
    with pytest.raises(FabricError, match=r"primitives\[0\].indices name vertex 1310725; POSITION"):
        read_gltf(CASES / "hostile/glb_index.glb")


def test_a_small_file_of_very_many_triangles_is_refused_before_they_are_made(tmp_path):
    made = Gltf()
    corners = np.tile(SQUARE_TRIANGLES.astype("u1"), 5000)
    mesh = made.mesh({"attributes": {"POSITION": made.add(SQUARE)}, "indices": made.add(corners)})
    for _ in range(2000):
        made.node(mesh=mesh)
    made.root["scenes"][0]["nodes"] = list(range(2000))
    with pytest.raises(FabricError, match="more than 10000000 triangles"):
        read(tmp_path, made)

"""Damaged and made-up mesh files: read, or refused in one line, within a second and 500 MB.

The readers themselves are tried, since `read_scene` turns whatever they raise into a refusal; and
`read_scene`, for what comes behind them. A warning of numpy's is a failure too.
"""

from __future__ import annotations

import copy
import json
import struct
from functools import partial

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fabricusd.scene.files.gltf import read_gltf
from fabricusd.scene.files.obj import read_obj
from fabricusd.scene.files.ply import read_ply
from fabricusd.scene.read import read_scene
from fabricusd.schema import load
from tests.fuzz import examples, mutated, refusal
from tests.scene.files.mesh_files import CASES, Gltf, one_square, ply

CLOTH = load("linen_plain")

TRIED = settings(
    max_examples=examples(100, 15_000), deadline=None, database=None,
    suppress_health_check=list(HealthCheck),
)  # fmt: skip

OBJS = [path.read_bytes() for path in sorted(CASES.glob("*/*.obj"))] + [
    b"o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\ng b c\nf 1//1 2//1 -1//1\nf 1 2 \\\n3\nl 1 2\n"
]
"""Files that are read, or nearly."""


def _gltf_files() -> list[bytes]:
    skinned = one_square(skin=0)
    attributes = skinned.root["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = skinned.add(np.zeros((4, 4), "u1"))
    attributes["WEIGHTS_0"] = skinned.add(np.ones((4, 4), "u1"), normalized=True)
    skinned.root["skins"] = [
        {"joints": [0], "inverseBindMatrices": skinned.add(np.eye(4, dtype="f4")[None])}
    ]
    morphed = one_square(weights=[0.5], rotation=[0, 0, 0, 1], scale=[1, 2, 3])
    primitive = morphed.root["meshes"][0]["primitives"][0]
    primitive["attributes"]["NORMAL"] = morphed.add(np.ones((4, 3), "i1"), normalized=True)
    primitive["targets"] = [{"POSITION": morphed.add(np.ones((4, 3), "f4"))}]
    view = morphed.root["accessors"][0]["bufferView"]
    morphed.root["accessors"][0]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": morphed.view(b"\0\1"), "componentType": 5121},
        "values": {"bufferView": view},
    }
    strip = Gltf()
    strip.node(children=[1])
    strip.node(mesh=strip.mesh(strip.square(mode=5), strip.square(mode=6)), translation=[1, 2, 3])
    return [made.glb() for made in (one_square(), skinned, morphed, strip)]


GLBS = _gltf_files()

PLYS = [
    ply(form, np.arange(5.0 * 8).reshape(5, 8) % 7, [[0, 1, 2], [3, 2, 1, 0], [0, 1, 2, 3, 4]],
        "x y z nx ny nz s t")
    for form in ("ascii", "binary_little_endian", "binary_big_endian")
]  # fmt: skip


@TRIED
@given(mutated(OBJS))
def test_damaged_objs(tmp_path, content):
    path = tmp_path / "x.obj"
    path.write_bytes(content)
    refusal(read_obj, path)


@TRIED
@given(mutated(GLBS))
def test_damaged_glbs(tmp_path, content):
    path = tmp_path / "x.glb"
    path.write_bytes(content)
    refusal(read_gltf, path)


@TRIED
@given(mutated(PLYS))
def test_damaged_plys(tmp_path, content):
    path = tmp_path / "x.ply"
    path.write_bytes(content)
    refusal(read_ply, path)


_INDEX = st.integers(-5, 5).map(str) | st.sampled_from(["", "1e3", "9" * 25, "-" + "9" * 25, "x"])
_NUMBER = st.floats(width=32).map(repr) | st.integers().map(str) | st.sampled_from(
    ["nan", "inf", "1e999", "-0", "1.", ".5", "0x1p3", "1_0", "+-1", "#", "\\", ""]
)  # fmt: skip
_WORDS = st.sampled_from(
    ["v", "vt", "vn", "f", "o", "g", "s", "l", "usemtl", "#", "\tv", " f", "vp", "surf", "v\\"]
)
_GOOD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nvn 0 0 1\n"


@st.composite
def objs(draw):
    """Text of lines that are nearly those of an OBJ."""
    lines = []
    for _ in range(draw(st.integers(1, 12))):
        word = draw(_WORDS)
        if word.strip() == "f":
            parts = draw(
                st.lists(st.lists(_INDEX, min_size=1, max_size=4).map("/".join), max_size=7)
            )
        elif word in ("o", "g", "usemtl", "#"):
            parts = [draw(st.text(max_size=8))]
        else:
            parts = draw(st.lists(_NUMBER, max_size=5))
        lines.append(" ".join([word, *parts]))
    end = draw(st.sampled_from(["\n", "\r\n", "\r", "\\\n"]))
    return (draw(st.sampled_from(["", _GOOD])) + end.join(lines)).encode("utf-8", "replace")


@TRIED
@given(objs())
def test_made_up_objs(tmp_path, content):
    path = tmp_path / "x.obj"
    path.write_bytes(content)
    refusal(read_obj, path)


_VALUE = (
    st.integers(-3, 9)
    | st.sampled_from([5120, 5121, 5122, 5123, 5125, 5126, 10**9, 10**18, 10**40, -1, 0.5, 1e308])
    | st.sampled_from(
        [None, True, "", "VEC3", "SCALAR", "MAT4", "../x", "data:,", {}, [], [0], [[]]]
    )
    | st.lists(st.floats(allow_nan=False, allow_infinity=False) | st.integers(), max_size=16)
)


def _places(value, here=()):
    """The way to every entry of a JSON value."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in items:
        yield (*here, key)
        if isinstance(inner, dict | list):
            yield from _places(inner, (*here, key))


def _parts(content):
    size = struct.unpack_from("<I", content, 12)[0]
    return json.loads(content[20 : 20 + size]), content[28 + size :]


ROOTS = [_parts(content) for content in GLBS]


@st.composite
def gltfs(draw):
    """A file whose JSON has some entries changed, lost or doubled."""
    root, data = draw(st.sampled_from(ROOTS))
    root = copy.deepcopy(root)
    for _ in range(draw(st.integers(1, 4))):
        way = draw(st.sampled_from(list(_places(root))))
        holder = root
        for key in way[:-1]:
            holder = holder[key]
        kind = draw(st.integers(0, 3))
        if kind == 0:
            del holder[way[-1]]
        elif kind == 1 and isinstance(holder, list):
            holder += [copy.deepcopy(holder[way[-1]])] * draw(st.integers(1, 9))
        else:
            # A copy: the strategy hands out its own lists, which later changes would change.
            holder[way[-1]] = copy.deepcopy(draw(_VALUE))
        if not root:
            break
    made = Gltf()
    made.root, made.data = root, bytearray(data)
    return json.dumps(root).encode() if draw(st.booleans()) else _packed(root, data)


def _packed(root, data):
    text = json.dumps(root).encode()
    text += b" " * (-len(text) % 4)
    return (
        struct.pack("<4sII", b"glTF", 2, 0) + struct.pack("<I4s", len(text), b"JSON") + text
        + struct.pack("<I4s", len(data), b"BIN\0") + data
    )  # fmt: skip


@TRIED
@given(gltfs())
def test_made_up_gltfs(tmp_path, content):
    path = tmp_path / "x.glb"
    path.write_bytes(content)
    refusal(read_gltf, path)


_COUNT = st.integers(0, 6) | st.sampled_from([10**6, 10**9, 10**17, 10**18, 10**30])
_TYPE = st.sampled_from(
    [
        "char",
        "uchar",
        "short",
        "ushort",
        "int",
        "uint",
        "float",
        "double",
        "int8",
        "float64",
        "bool",
    ]
)
_PLY_NAME = st.sampled_from(
    [*"xyzstuv", "nx", "ny", "nz", "vertex_indices", "vertex_index", "texcoord", "red"]
)


@st.composite
def plys(draw):
    """A header of any elements, and rows that may or may not be theirs."""
    form = draw(st.sampled_from(["ascii", "binary_little_endian", "binary_big_endian"]))
    lines = ["ply", f"format {form} 1.0"]
    rows = []
    elements = [draw(st.sampled_from(["vertex", "face", "tristrips", "edge"])) for _ in range(2)]
    if draw(st.booleans()):
        elements = ["vertex", "face"]
    for element in elements:
        count = draw(_COUNT)
        lines.append(f"element {element} {count}")
        names = ["x", "y", "z"] if element == "vertex" and draw(st.booleans()) else []
        names += draw(st.lists(_PLY_NAME, max_size=4))
        for name in names:
            is_list = draw(st.booleans()) if name not in "xyz" else False
            kinds = f"list {draw(_TYPE)} {draw(_TYPE)}" if is_list else draw(_TYPE)
            lines.append(f"property {kinds} {name}")
        for _ in range(min(count, 6)):
            rows.append(" ".join(draw(st.lists(_INDEX | _NUMBER, max_size=7))))
    head = "\n".join([*lines, "end_header", ""]).encode()
    body = "\n".join(rows).encode() if form == "ascii" else draw(st.binary(max_size=200))
    return head + body


@TRIED
@given(plys())
def test_made_up_plys(tmp_path, content):
    path = tmp_path / "x.ply"
    path.write_bytes(content)
    refusal(read_ply, path)


@TRIED
@given(st.sampled_from([(".obj", OBJS), (".glb", GLBS), (".ply", PLYS)]), st.data())
def test_damaged_files_as_scenes(tmp_path, kind, data):
    suffix, contents = kind
    path = (tmp_path / "x").with_suffix(suffix)
    path.write_bytes(data.draw(mutated(contents)))
    refusal(partial(read_scene, fabric=CLOTH), path)


def test_the_files_that_are_damaged_are_read_when_they_are_whole(tmp_path):
    for reader, contents in ((read_gltf, GLBS), (read_ply, PLYS), (read_obj, OBJS[-1:])):
        for content in contents:
            path = tmp_path / "x"
            path.write_bytes(content)
            assert reader(path).pieces

"""Attributes of a wrong type or with values out of range: a note each, and the rest is rendered."""

from __future__ import annotations

import re

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.reference.rays.camera import build_lens
from fabricusd.scene.read import read_scene
from tests.conftest import CHECKOUT

CASES = CHECKOUT / "tests" / "cases"
WHOLE = CASES / "usd_everything" / "scene.usda"

NOT_READ = (
    # An infinitely thin light is no point here, and the cone's note says all of shaping.
    "S.treatAsPoint", "D.inputs:shaping:cone:softness", "D.inputs:shaping:focus",
    # Noted without a type: clearcoat is left out whatever it holds.
    "S.inputs:clearcoat",
    # A surface that is refined has no normals of its own, a family says nothing of a fabric, and a
    # fabric goes before a display colour.
    "B.normals", "Sub.familyName", "T.familyName", "Q.primvars:displayColor",
)  # fmt: skip
"""Attributes of the scene that are not asked for, or not by themselves."""


def attributes() -> dict[str, tuple[int, str]]:
    """Every attribute of the scene: its line, and that line with a path for a value."""
    found = {}
    prim = ""
    for k, line in enumerate(WHOLE.read_text().splitlines()):
        named = re.match(r'\s*(?:def|over) \w* ?"(\w+)"', line)
        prim = named[1] if named else prim
        parts = re.match(r"(\s*(?:uniform )?([\w\[\]]+) ([\w:]+) = )[^{]*?( \()?$", line)
        if parts and parts[2] not in ("rel", "prepend"):
            found[f"{prim}.{parts[3]}"] = k, f"{parts[1]}</x>{parts[4] or ''}"
    return found


ATTRIBUTES = attributes()


@pytest.fixture
def beside(tmp_path):
    for name in ("tex.png", "env.exr"):
        (tmp_path / name).symlink_to(WHOLE.parent / name)
    return tmp_path


def notes_with(folder, text):
    (folder / "scene.usda").write_text(text)
    scene = read_scene(folder / "scene.usda", time_code=2.0, complexity="medium")
    assert scene.meshes
    for mesh in scene.meshes:
        assert np.isfinite(mesh.points).all()
    return scene.notes


def test_every_attribute_that_holds_a_path_gets_a_note(beside):
    assert len(ATTRIBUTES) > 100
    before = notes_with(beside, WHOLE.read_text())
    silent = []
    for name, (number, changed) in ATTRIBUTES.items():
        lines = WHOLE.read_text().splitlines()
        lines[number] = changed
        notes = notes_with(beside, "\n".join(lines))
        if not set(notes) - set(before):
            silent.append(name)
        assert not any(".cpp" in note or "pxrInternal" in note for note in notes), name
    assert sorted(silent) == sorted(NOT_READ)


TYPES = {
    # name: (line as it is, line as it is made, words of the note)
    "a word for points": (
        "point3f[] points = [(0, 0, 0), (0.3, 0, 0), (0, 0.3, 0)]",
        'string points = "a"',
        "/World/PI/P.points is of type string; it must be point3f[]; it is left out",
    ),
    "real numbers for counts": (
        "int[] faceVertexCounts = [3]",
        "float[] faceVertexCounts = [3.5]",
        "/World/PI/P.faceVertexCounts is of type float[]; it must be int[]; it is left out",
    ),
    "three numbers for two": (
        "float2 clippingRange = (0.01, 100)",
        "float3 clippingRange = (0.01, 100, 7)",
        "/World/Cam.clippingRange is of type float3; it must be float2; (1, 1000000) is taken",
    ),
    "an array for a number": (
        "float focalLength = 35",
        "float[] focalLength = [35]",
        "/World/Cam.focalLength is of type float[]; it must be float; 50 is taken",
    ),
    "a number for a switch": (
        "bool inputs:normalize = 1",
        "int inputs:normalize = 1",
        "/World/S.inputs:normalize is of type int; it must be bool; False is taken",
    ),
    "a word for an order of transforms": (
        'uniform token[] xformOpOrder = ["xformOp:translate"]',
        'uniform string xformOpOrder = "xformOp:translate"',
        "xformOpOrder is of type string; it must be token[]; it is left out",
    ),
}


@pytest.mark.parametrize("name", TYPES)
def test_a_note_names_the_type_and_the_one_it_must_be(beside, name):
    before, after, words = TYPES[name]
    text = WHOLE.read_text()
    assert before in text
    assert any(words in note for note in notes_with(beside, text.replace(before, after)))


SAME = {
    # name: (line as it is, line as it is made)
    "points of double precision": (
        "point3f[] points = [(0, 0, 0), (0.3",
        "double3[] points = [(0, 0, 0), (0.3",
    ),
    "a whole number for a length": ("float focalLength = 35", "int focalLength = 35"),
    "unsigned indices": (
        "int[] faceVertexIndices = [0, 1, 2]",
        "uint[] faceVertexIndices = [0, 1, 2]",
    ),
}


@pytest.mark.parametrize("name", SAME)
def test_numbers_of_another_precision_are_taken(beside, name):
    before, after = SAME[name]
    text = WHOLE.read_text()
    assert before in text
    assert notes_with(beside, text.replace(before, after)) == notes_with(beside, text)


PATHS = {
    "scene_indices_path": "/World/PI/P.faceVertexIndices is a path; it must be int[]",
    "scene_clipping_type": "/World/Cam.clippingRange is a path; it must be float2",
    "scene_aperture_nonfinite": "/World/Cam has horizontalAperture 1e+30, which must be above 0",
}


@pytest.mark.parametrize("name", PATHS)
def test_a_hostile_scene_is_read_with_a_note(name):
    scene = read_scene(CASES / "hostile" / f"{name}.usda")
    assert any(PATHS[name] in note for note in scene.notes)
    assert (scene.camera is None) == (name == "scene_aperture_nonfinite")


NUMBERS = ("0", "-1", "1e-30", "1e30", "1e38", "-1e30", "inf", "-inf", "nan")
CAMERA = {
    "horizontalAperture": "float horizontalAperture = 36",
    "verticalAperture": "float verticalAperture = 24",
    "horizontalApertureOffset": "float horizontalApertureOffset = 0",
    "focalLength": "float focalLength = 35",
    "focusDistance": "float focusDistance = 3",
    "fStop": "float fStop = 2",
    "exposure": "float exposure = 0",
}


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("name", [*CAMERA, "near", "far", "position", "scale", "metersPerUnit"])
def test_a_camera_of_extreme_numbers_has_sound_rays_or_is_left_out(
    beside, name, number, projection
):
    text = WHOLE.read_text().replace('"perspective"', f'"{projection}"')
    before, after = {
        "near": ("(0.01, 100)", f"({number}, 100)"),
        "far": ("(0.01, 100)", f"(0.01, {number})"),
        "position": ("(0, 0, 3)", f"(0, 0, {number})"),
        "scale": (
            "double3 xformOp:translate = (0, 0, 3)",
            f"double3 xformOp:scale = ({number}, 1, 1)",
        ),
        "metersPerUnit": ("metersPerUnit = 1", f"metersPerUnit = {number}"),
    }.get(name) or (CAMERA[name], CAMERA[name].rsplit(" ", 1)[0] + f" {number}")
    assert before in text
    text = text.replace(before, after)
    if name == "scale":
        text = text.replace('["xformOp:translate"]', '["xformOp:scale"]', 1)
    (beside / "scene.usda").write_text(text)
    try:
        scene = read_scene(beside / "scene.usda")
    except FabricError:
        return
    if scene.camera is None:
        assert any(note.startswith("/World/Cam") for note in scene.notes)
        return
    lens = build_lens(scene.camera, 64, 48, np.zeros(3), "tent")
    for name, part in lens._asdict().items():
        assert np.isfinite(part).all()
        if name != "far":
            assert np.square(np.asarray(part, np.float64)).max() <= np.finfo(np.float32).max
    assert abs(scene.camera.exposure) <= 64

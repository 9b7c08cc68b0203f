"""On which prims a binding has an effect, and what `check` says of the others."""

from __future__ import annotations

import pytest

from fabricusd.schema import check

CLOTH = 'def WovenFabric "Cloth"\n{\n    def WovenThread "Warp"\n    {\n    }\n}\n'
API = '(prepend apiSchemas = ["WovenBindingAPI"])\n{\n    rel fabric:binding = </Cloth>\n'
UV = 'texCoord2f[] primvars:st = [(0, 0)] (interpolation = "vertex")'


def subset(parent: str, element: str) -> str:
    said = f'uniform token elementType = "{element}"\nint[] indices = [0]\n'
    return f'def {parent} "P"\n{{\n{UV}\ndef GeomSubset "S" {API}{said}}}\n}}\n'


WORN = {
    "a mesh": f'def Mesh "P" {API}{UV}\n}}\n',
    "a material": f'def Material "P" {API}}}\n',
    "an Xform": f'def Xform "P" {API}}}\n',
    "a Scope": f'def Scope "P" {API}}}\n',
    "a prim without a type": f'def "P" {API}}}\n',
    "a subset of faces": subset("Mesh", "face"),
}
NOT_WORN = {
    "a sphere": (f'def Sphere "P" {API}}}\n', "is on a Sphere"),
    "a camera": (f'def Camera "P" {API}}}\n', "is on a Camera"),
    "a light": (f'def RectLight "P" {API}}}\n', "is on a RectLight"),
    "a shader": (f'def Shader "P" {API}}}\n', "is on a Shader"),
    "a subset of points": (subset("Mesh", "point"), "is on a GeomSubset of the type 'point'"),
    "a subset of no mesh": (subset("Xform", "face"), "is on a GeomSubset of no mesh"),
}


def findings(body, tmp_path):
    path = tmp_path / "stage.usda"
    path.write_text(f"#usda 1.0\n{CLOTH}{body}")
    return check(str(path))


@pytest.mark.parametrize("name", WORN)
def test_a_binding_may_be_on(name, tmp_path):
    assert findings(WORN[name], tmp_path) == []


@pytest.mark.parametrize("name", NOT_WORN)
def test_a_binding_has_no_effect_on(name, tmp_path):
    body, words = NOT_WORN[name]
    [finding] = findings(body, tmp_path)
    assert finding.rule == "BindingCanBeWorn"
    assert words in finding.problem
    assert "it must be on a Mesh" in finding.problem


def test_a_binding_without_a_target_takes_the_fabric_off(tmp_path):
    assert findings('def Mesh "P"\n{\nrel fabric:binding = None\n}\n', tmp_path) == []
    with_api = 'def Mesh "P" (prepend apiSchemas = ["WovenBindingAPI"])\n{\n'
    uv = f"{UV}\n"
    assert findings(f"{with_api}{uv}rel fabric:binding = None\n}}\n", tmp_path) == []
    # Nothing authored is no way to say so.
    [finding] = findings(f"{with_api}{uv}}}\n", tmp_path)
    assert finding.rule == "BindingNamesAFabric"

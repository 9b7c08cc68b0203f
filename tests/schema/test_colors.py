"""A colour means what its color space says, on the attribute or above it."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf, Usd, UsdValidation

from fabricusd import FabricError
from fabricusd.schema import check, load, preset_names, save
from fabricusd.schema.colors import AS_IT_IS, NAMED
from fabricusd.schema.source import preset_path

EARLIER = "lin_displayp3_scene"
"""What USD 24.11 calls lin_p3d65_scene."""

ALBEDO = (0.5, 0.2, 0.1)


def cloth(tmp_path, metadata: str = "", above: str = "", body: str = ""):
    path = tmp_path / "cloth.usda"
    api = ' (\n    prepend apiSchemas = ["ColorSpaceAPI"]\n)' if above else ""
    named = f'uniform token colorSpace:name = "{above}"' if above else ""
    own = f' (\n    colorSpace = "{metadata}"\n)' if metadata else ""
    path.write_text(
        f'#usda 1.0\ndef Scope "World"{api}\n{{\n{named}\n{body}\ndef WovenFabric "Cloth"\n{{\n'
        f'def WovenThread "T"\n{{\nuniform color3d thread:albedo = {ALBEDO}{own}\n}}\n}}\n}}\n'
    )
    return path


def albedo(path):
    return load(path).threads["T"].albedo


def by_usd(name: str) -> np.ndarray:
    made = Gf.ColorSpace("lin_rec709_scene").Convert(Gf.ColorSpace(name), Gf.Vec3f(*ALBEDO))
    return np.array(made.GetRGB())


def inside(name: str) -> bool:
    return bool((by_usd(name) >= 0).all())


@pytest.mark.skipif(Usd.GetVersion() < (0, 26), reason="ACES was not adapted to D65")
@pytest.mark.parametrize("name", [name for name in NAMED if name != EARLIER])
@pytest.mark.parametrize("where", ["metadata", "above"])
def test_a_color_is_converted_as_usd_converts_it(name, where, tmp_path):
    path = cloth(tmp_path, **{where: name})
    if not inside(name):
        with pytest.raises(FabricError, match=r"in linear Rec\. 709; it must be at least 0"):
            load(path)
        return
    assert albedo(path) == pytest.approx(by_usd(name), rel=2e-4, abs=2e-5)
    assert albedo(path) != pytest.approx(ALBEDO, rel=1e-2)
    assert [finding for finding in check(path) if finding.severity == "error"] == []


def test_every_color_space_that_usd_names_is_read():
    names = {getattr(Gf.ColorSpaceNames, n) for n in dir(Gf.ColorSpaceNames) if n[0] != "_"}
    assert names - {*AS_IT_IS, *NAMED} == set()


def test_an_earlier_name_of_a_color_space_is_read(tmp_path):
    earlier = albedo(cloth(tmp_path, metadata=EARLIER))
    (tmp_path / "cloth.usda").unlink()
    assert earlier == pytest.approx(by_usd("lin_p3d65_scene"), rel=2e-4)


@pytest.mark.parametrize("name", [name for name in AS_IT_IS if name])
def test_a_color_that_is_no_other_stays_as_it_is(name, tmp_path):
    assert albedo(cloth(tmp_path, metadata=name)) == ALBEDO


def test_a_color_without_a_color_space_is_linear(tmp_path):
    assert albedo(cloth(tmp_path)) == ALBEDO


def test_the_attributes_own_color_space_is_the_stronger(tmp_path):
    path = cloth(tmp_path, metadata="lin_rec709_scene", above="srgb_rec709_scene")
    assert albedo(path) == ALBEDO


def test_what_is_written_says_its_color_space_and_keeps_it_below_another(tmp_path):
    save(load("silk_shot"), tmp_path / "silk.usda")
    assert 'colorSpace = "lin_rec709_scene"' in (tmp_path / "silk.usda").read_text()
    scene = tmp_path / "scene.usda"
    scene.write_text(
        '#usda 1.0\ndef Scope "World" (\n    prepend apiSchemas = ["ColorSpaceAPI"]\n)\n{\n'
        'uniform token colorSpace:name = "lin_ap1_scene"\n'
        'def "silk_shot" (\n    references = @silk.usda@\n)\n{\n}\n}\n'
    )
    assert load(scene) == load("silk_shot")


def test_a_fallback_is_the_schemas_whatever_is_above(tmp_path):
    path = cloth(tmp_path, above="srgb_rec709_scene")
    assert load(path).threads["T"].color == (0.5, 0.5, 0.5)


@pytest.mark.parametrize("where", ["metadata", "above"])
def test_an_unknown_color_space_is_a_fault_with_its_name(where, tmp_path):
    path = cloth(tmp_path, **{where: "ACES - ACEScg"})
    (finding,) = check(path)
    assert (finding.rule, finding.severity) == ("ColorSpaceKnown", "error")
    assert "'ACES - ACEScg'; it must be one of lin_rec709_scene, srgb_rec709" in finding.problem
    with pytest.raises(FabricError, match="color space 'ACES - ACEScg'"):
        load(path)


DEFINED = """#usda 1.0
def Scope "World" (
    prepend apiSchemas = ["ColorSpaceDefinitionAPI:house", "ColorSpaceAPI"]
)
{
    uniform token colorSpace:name = "house"
    uniform token colorSpaceDefinition:house:name = "house"
    float2 colorSpaceDefinition:house:redChroma = (0.64, 0.33)
    float2 colorSpaceDefinition:house:greenChroma = (0.3, 0.6)
    float2 colorSpaceDefinition:house:blueChroma = (0.15, 0.06)
    float2 colorSpaceDefinition:house:whitePoint = (0.3127, 0.329)
    float colorSpaceDefinition:house:gamma = 2
    def WovenFabric "Cloth"
    {
        def WovenThread "T"
        {
            uniform color3d thread:albedo = (0.5, 0.2, 0.1)
        }
    }
}
"""


@pytest.mark.skipif(not hasattr(Usd, "ColorSpaceAPI"), reason="USD 24 defines no color spaces")
def test_a_color_space_that_the_stage_defines_is_read(tmp_path):
    path = tmp_path / "cloth.usda"
    path.write_text(DEFINED)
    assert check(path) == []
    assert albedo(path) == pytest.approx([x * x for x in ALBEDO], rel=1e-3)


@pytest.mark.parametrize("name", preset_names())
def test_every_color_of_a_preset_says_its_color_space(name):
    stage = Usd.Stage.Open(str(preset_path(name)))
    colors = [
        attribute
        for prim in stage.Traverse()
        for attribute in prim.GetAuthoredAttributes()
        if attribute.GetTypeName().role == "Color"
    ]
    assert colors
    assert {attribute.GetColorSpace() for attribute in colors} == {"lin_rec709_scene"}


def test_usds_validators_find_nothing_in_what_is_written(tmp_path):
    save(load("silk_shot"), tmp_path / "silk.usda")
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    stage = Usd.Stage.Open(str(tmp_path / "silk.usda"))
    found = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [error.GetMessage() for error in found] == []

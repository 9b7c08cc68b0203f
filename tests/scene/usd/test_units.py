"""Assets in another unit, or with another axis up, than the stage that references them."""

from __future__ import annotations

import re

import pytest
from pxr import Sdf, Usd, UsdGeom

from fabricusd.errors import FabricError
from fabricusd.scene.read import read_scene
from fabricusd.schema.source import PRESETS
from tests.reference.stages import bind_fabric, new_stage, read, square


def asset(folder, name="shirt.usda", metres=0.01, up="Y"):
    """A square of 2 units in a layer of its own."""
    stage = Usd.Stage.CreateNew(str(folder / name))
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    UsdGeom.SetStageUpAxis(stage, up)
    square(stage, "/Shirt/square")
    stage.SetDefaultPrim(stage.GetPrimAtPath("/Shirt"))
    stage.GetRootLayer().Save()
    return f"./{name}"


def referenced(stage, folder, **kind):
    prim = UsdGeom.Xform.Define(stage, "/World/Shirt").GetPrim()
    prim.GetReferences().AddReference(asset(folder, **kind))
    return UsdGeom.Xformable(prim)


def plainly(stage, folder):
    referenced(stage, folder)


def twice(stage, folder):
    for name in ("/World/One", "/World/Two"):
        prim = UsdGeom.Xform.Define(stage, name).GetPrim()
        prim.GetReferences().AddReference(asset(folder) if name == "/World/One" else "./shirt.usda")


def as_payload(stage, folder):
    UsdGeom.Xform.Define(stage, "/World/Shirt").GetPrim().GetPayloads().AddPayload(asset(folder))


def as_instance(stage, folder):
    referenced(stage, folder).GetPrim().SetInstanceable(True)


def through_another_layer(stage, folder):
    inner = asset(folder)
    outer = Usd.Stage.CreateNew(str(folder / "rack.usda"))
    UsdGeom.SetStageMetersPerUnit(outer, 1.0)
    prim = UsdGeom.Xform.Define(outer, "/Rack/Shirt").GetPrim()
    prim.GetReferences().AddReference(inner)
    outer.SetDefaultPrim(outer.GetPrimAtPath("/Rack"))
    outer.GetRootLayer().Save()
    stage.DefinePrim("/World/Rack").GetReferences().AddReference("./rack.usda")


def in_an_instanced_prim(stage, folder):
    through_another_layer(stage, folder)
    stage.GetPrimAtPath("/World/Rack").SetInstanceable(True)


def as_sublayer(stage, folder):
    asset(folder)
    stage.GetRootLayer().subLayerPaths.append("./shirt.usda")


def with_z_up(stage, folder):
    referenced(stage, folder, metres=1.0, up="Z")


def scaled_but_not_turned(stage, folder):
    referenced(stage, folder, up="Z").AddScaleOp().Set((0.01, 0.01, 0.01))


def scaled_the_wrong_way(stage, folder):
    referenced(stage, folder).AddScaleOp().Set((100, 100, 100))


NOTED = {
    # name: (how the asset comes in, words of the one note)
    "a reference": (
        plainly,
        "references shirt.usda, which is in units of 0.01 m in a stage of 1 m",
    ),
    "two references": (twice, "/World/One references shirt.usda, which is in units of 0.01 m"),
    "a payload": (as_payload, "references shirt.usda, which is in units of 0.01 m"),
    "a native instance": (as_instance, "references shirt.usda, which is in units of 0.01 m"),
    "through another layer": (through_another_layer, "/World/Rack/Shirt references shirt.usda"),
    "inside an instance": (in_an_instanced_prim, "/World/Rack/Shirt references shirt.usda"),
    "a sublayer": (as_sublayer, "shirt.usda is in units of 0.01 m in a stage of 1 m"),
    "another axis up": (with_z_up, "references shirt.usda, which has Z up in a stage with Y up"),
    "scaled, not turned": (scaled_but_not_turned, "units of 0.01 m in a stage of 1 m and has Z up"),
    "scaled the wrong way": (scaled_the_wrong_way, "in units of 0.01 m in a stage of 1 m"),
}


def in_the_same_unit(stage, folder):
    referenced(stage, folder, metres=1.0)


def scaled(stage, folder):
    referenced(stage, folder).AddScaleOp().Set((0.01, 0.01, 0.01))


def scaled_and_a_little_larger(stage, folder):
    referenced(stage, folder).AddScaleOp().Set((0.011, 0.011, 0.011))


def scaled_by_a_parent(stage, folder):
    referenced(stage, folder)
    UsdGeom.Xform(stage.GetPrimAtPath("/World")).AddScaleOp().Set((0.01, 0.01, 0.01))


def resolved_by_usd(stage, folder):
    prim = referenced(stage, folder)
    prim.AddScaleOp(opSuffix="unitsResolve").Set((0.01, 0.01, 0.01))


def turned(stage, folder):
    referenced(stage, folder, metres=1.0, up="Z").AddRotateXOp().Set(-90.0)


def a_layer_that_says_nothing(stage, folder):
    layer = Sdf.Layer.FindOrOpen(str(folder / asset(folder)))
    layer.pseudoRoot.ClearInfo("metersPerUnit")
    layer.pseudoRoot.ClearInfo("upAxis")
    layer.Save()
    UsdGeom.Xform.Define(stage, "/World/Shirt").GetPrim().GetReferences().AddReference(
        "./shirt.usda"
    )


def a_fabric(stage, folder):
    """Its densities are per centimetre, whatever the layer's unit."""
    layer = Sdf.Layer.FindOrOpen(str(PRESETS / "linen_plain.usda"))
    assert layer.pseudoRoot.GetInfo("metersPerUnit") != 1.0
    bind_fabric(stage, square(stage, "/World/square").GetPrim())


SILENT = {
    "the same unit": in_the_same_unit,
    "a scale that makes up for it": scaled,
    "such a scale, and a little more": scaled_and_a_little_larger,
    "a scale of the parent": scaled_by_a_parent,
    "a unitsResolve op": resolved_by_usd,
    "a turn that makes up for it": turned,
    "a layer that says nothing": a_layer_that_says_nothing,
    "a layer of fabrics alone": a_fabric,
}


def notes_of(stage, folder, bring_in):
    UsdGeom.Xform.Define(stage, "/World")
    bring_in(stage, folder)
    return [n for n in read(stage).notes if "units of" in n or " up in " in n]


@pytest.mark.parametrize("name", NOTED)
def test_an_asset_in_another_unit_is_noted_once(tmp_path, name):
    bring_in, words = NOTED[name]
    [note] = notes_of(new_stage(tmp_path), tmp_path, bring_in)
    assert words in note
    assert "convert" in note


@pytest.mark.parametrize("name", SILENT)
def test_an_asset_in_the_stages_unit_or_brought_to_it_is_not_noted(tmp_path, name):
    assert notes_of(new_stage(tmp_path), tmp_path, SILENT[name]) == []


METADATA = {
    # line of the layer: words of the note
    "metersPerUnit = </x>": "has a metersPerUnit that is not a number; 0.01 is taken",
    'metersPerUnit = "a"': "no value of its type",
    "metersPerUnit = nan": "has metersPerUnit nan; 0.01 is taken; it must be from 1e-12 to 1e+16",
    "metersPerUnit = -1": "has metersPerUnit -1; 0.01 is taken",
    "metersPerUnit = 1e308": "has metersPerUnit 1e+308; 0.01 is taken",
    "upAxis = </x>": "has an upAxis that is of another type; it must be Y or Z; Y is taken",
    'upAxis = "X"': "has an upAxis that is X; it must be Y or Z; Y is taken",
}


@pytest.mark.parametrize("line", METADATA)
def test_a_stage_whose_unit_or_axis_is_none_is_read_with_a_note_or_refused(tmp_path, line):
    stage = new_stage(tmp_path)
    square(stage)
    stage.GetRootLayer().Save()
    text = (tmp_path / "scene.usda").read_text()
    name = line.split()[0]
    file = tmp_path / "changed.usda"
    file.write_text(re.sub(rf"{name} = .*", line, text))
    assert line in file.read_text()
    try:
        scene = read_scene(file)
    except FabricError as error:
        found = [str(error)]
    else:
        assert scene.up_axis == "Y"
        found = scene.notes
    assert any(METADATA[line] in words for words in found)

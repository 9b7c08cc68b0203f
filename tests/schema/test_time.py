"""Fabrics are read at one time: attributes are uniform, and values in time are told of."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest
from pxr import Sdf, Usd, UsdGeom

from fabricusd.errors import FabricWarning
from fabricusd.fabric import Binding
from fabricusd.scene.usd.stage import read_usd_scene
from fabricusd.schema import check, load, read_fabric, write_binding, write_fabric
from fabricusd.schema.access import BINDING_API, TYPES, definition
from fabricusd.schema.anysource import load_any
from fabricusd.schema.attributes import every_attribute
from fabricusd.schema.source import PRESETS

MOVING = Path(__file__).parent / "bad" / "value_is_constant.usda"
WORDS = "/Cloth/Warp thread:gammaSurface has values in time; only its value at rest is read"


def test_reading_a_value_that_moves_warns_and_takes_the_one_at_rest():
    with pytest.warns(FabricWarning, match=WORDS):
        fabric = load(MOVING)
    assert fabric.threads["Warp"].gamma_surface == pytest.approx(0.2094395)


def test_a_note_is_given_in_place_of_the_warning():
    notes: list[str] = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        stage = Usd.Stage.Open(str(MOVING))
        read_fabric(stage.GetPrimAtPath("/Cloth"), notes.append)
        _, told = load_any(MOVING)
    assert [line.startswith(WORDS) for line in (*notes, *told)] == [True, True]


def test_a_scene_notes_a_fabric_and_a_binding_that_move(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "scene.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    stage.GetRootLayer().subLayerPaths.append(str(MOVING))
    mesh = UsdGeom.Mesh.Define(stage, "/Sheet")
    mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (1, 1, 0)])
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
    uv = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray)
    uv.SetInterpolation("vertex")
    uv.Set([(0, 0), (1, 0), (1, 1)])
    fabric = load_any(MOVING)[0]
    write_binding(mesh.GetPrim(), "/Cloth", Binding(fabric=fabric, metres_per_uv=1.0))
    mesh.GetPrim().GetAttribute("fabric:binding:rotation").Set(30.0, 5.0)
    stage.Save()
    notes = read_usd_scene(tmp_path / "scene.usda").notes
    for name in ("thread:gammaSurface", "fabric:binding:rotation"):
        assert [n for n in notes if f"{name} has values in time" in n], name
    assert {f.property for f in check(tmp_path / "scene.usda")} == {
        "thread:gammaSurface",
        "fabric:binding:rotation",
    }


def test_every_attribute_of_the_schema_is_uniform():
    for name in (*TYPES, BINDING_API):
        for spec in definition(name).values():
            if isinstance(spec, Sdf.AttributeSpec):
                assert spec.variability == Sdf.VariabilityUniform, spec.path


def test_what_is_written_is_uniform():
    stage = Usd.Stage.CreateInMemory()
    prim = write_fabric(stage, "/Cloth", load("velvet"))
    mesh = UsdGeom.Mesh.Define(stage, "/Sheet").GetPrim()
    write_binding(mesh, "/Cloth", Binding(fabric=load("velvet")))
    for each in (*Usd.PrimRange(prim), mesh):
        for attribute in each.GetAuthoredAttributes():
            (spec,) = attribute.GetPropertyStack()
            assert spec.variability == Sdf.VariabilityUniform, spec.path


@pytest.mark.parametrize("path", sorted(PRESETS.rglob("*.usda")), ids=lambda path: path.stem)
def test_presets_are_uniform(path):
    layer = Sdf.Layer.FindOrOpen(str(path))

    def look(at: Sdf.Path) -> None:
        spec = layer.GetObjectAtPath(at)
        if isinstance(spec, Sdf.AttributeSpec):
            assert spec.variability == Sdf.VariabilityUniform, at

    layer.Traverse(Sdf.Path.absoluteRootPath, look)


@pytest.mark.parametrize("entry", every_attribute(), ids=lambda entry: entry.name)
def test_units_and_limits_reach_the_schema_that_usd_reads(entry):
    registry = Usd.SchemaRegistry()
    owner = {"Thread": "WovenThread", "Binding": BINDING_API}.get(entry.owner.__name__)
    found = registry.FindConcretePrimDefinition(owner or "WovenFabric")
    found = found or registry.FindAppliedAPIPrimDefinition(owner)
    # USD keeps no customData of a schema in memory: the unit is in the layer and in the words.
    assert definition(owner or "WovenFabric")[entry.name].customData["unit"]
    assert "Unit: " in found.GetPropertyDocumentation(entry.name)
    limits = found.GetPropertyMetadata(entry.name, "limits")
    if not entry.limits:
        assert limits is None
        return
    soft = limits.get("soft", limits["hard"])
    ends = {"minimum": ("minimum", "above"), "maximum": ("maximum", "below")}
    for end, names in ends.items():
        bounds = [entry.limits[n] for n in names if entry.limits.get(n) is not None]
        assert (end in soft) == bool(bounds)
        if bounds:
            held = soft[end]
            for number in tuple(held) if hasattr(held, "__len__") else (held,):
                assert number * entry.scale == pytest.approx(bounds[0])

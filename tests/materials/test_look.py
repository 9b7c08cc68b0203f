"""The look layer over a garment: what it binds, what it leaves alone, and how it fails."""

from __future__ import annotations

import json
import shutil

import pytest
from pxr import Usd, UsdGeom, UsdShade, UsdUtils, UsdValidation

from fabricusd.cli.main import main
from fabricusd.errors import FabricError
from fabricusd.materials.materials import write_materials
from fabricusd.materials.recipes import Settings
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import FabricSurface
from tests.materials.scenes import bake_shirt

PLAIN = Settings(fitted=False)


@pytest.fixture(scope="module")
def shirt(tmp_path_factory):
    return bake_shirt(tmp_path_factory.mktemp("shirt"))


@pytest.fixture(scope="module")
def over(shirt, tmp_path_factory):
    """A look over the scene, in a folder of its own."""
    scene, baked = shirt
    out = tmp_path_factory.mktemp("look") / "look.usda"
    return write_materials(baked, out, PLAIN, scene=scene), out


@pytest.fixture(scope="module")
def alone(shirt, tmp_path_factory):
    """A look over the baked mesh."""
    out = tmp_path_factory.mktemp("alone") / "look.usda"
    return write_materials(shirt[1], out, PLAIN), out


def bound(stage, variant):
    """Material and fabric of each subset under a variant."""
    root = stage.GetDefaultPrim()
    root.GetVariantSets().SetSelection("fabricLook", variant)
    found = {}
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Subset):
            material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
            found[prim.GetName()] = (
                material.GetPath().name if material else None,
                "WovenBindingAPI" in prim.GetAppliedSchemas(),
            )
    return found


def test_each_variant_binds_what_it_says(over):
    stage = Usd.Stage.Open(str(over[1]))
    assert stage.GetDefaultPrim().GetVariantSet("fabricLook").GetVariantSelection() == "baked"
    button = {"Button": ("Button", False)}
    baked = {"Linen": ("Body_0", False), "Pile": ("Body_1", False)}
    assert bound(stage, "baked") == baked | button
    plain = {"Linen": ("Body_0_plain", True), "Pile": ("Body_1_plain", True)}
    assert bound(stage, "procedural") == plain | button
    assert bound(stage, "off") == {"Linen": ("Old", False), "Pile": ("Old", False)} | button


def test_a_look_without_the_scene_goes_over_the_baked_mesh(alone):
    stage = Usd.Stage.Open(str(alone[1]))
    assert bound(stage, "baked") == {"lay_0": ("Body_0", False), "lay_1": ("Body_1", False)}
    assert all(fabric for _, fabric in bound(stage, "procedural").values())
    assert set(bound(stage, "off").values()) == {(None, False)}


def test_the_tracer_renders_textures_or_the_fabric_by_the_variant(alone):
    stage = Usd.Stage.Open(str(alone[1]))
    for variant, expected in (("baked", False), ("procedural", True)):
        stage.GetDefaultPrim().GetVariantSets().SetSelection("fabricLook", variant)
        path = alone[1].with_name(f"{variant}.usda")
        stage.GetRootLayer().Export(str(path))
        kinds = {isinstance(m, FabricSurface) for m in read_scene(path).materials}
        assert expected in kinds
        assert (variant == "baked") == (kinds == {False})


def test_a_procedural_binding_lays_the_fabric_where_the_textures_have_it(alone, shirt):
    stage = Usd.Stage.Open(str(alone[1]))
    stage.GetDefaultPrim().GetVariantSets().SetSelection("fabricLook", "procedural")
    per_unit = stage.GetPrimAtPath("/Garment/Body/lay_0").GetAttribute(
        "fabric:binding:threadsPerUnit"
    )
    assert tuple(per_unit.Get()) == pytest.approx((24.0, 24.0))


@pytest.mark.parametrize("which", ["over", "alone"])
def test_usd_finds_no_fault_but_node_ids_that_its_wheel_does_not_know(which, request):
    path = request.getfixturevalue(which)[1]
    stage = Usd.Stage.Open(str(path))
    registry = UsdValidation.ValidationRegistry()
    context = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())
    for variant in ("baked", "procedural", "off"):
        stage.GetDefaultPrim().GetVariantSets().SetSelection("fabricLook", variant)
        faults = [e for e in context.Validate(stage) if "shaderId 'ND_" not in e.GetMessage()]
        assert [f.GetMessage() for f in faults] == []


def test_a_validator_bites_on_a_material_outside_its_shaders(over, tmp_path):
    stage = Usd.Stage.Open(str(over[1]))
    stage.GetRootLayer().Export(str(tmp_path / "look.usda"))
    broken = Usd.Stage.Open(str(tmp_path / "look.usda"))
    shader = UsdShade.Shader.Define(broken, "/Shirt/Lost")
    shader.CreateIdAttr("UsdUVTexture")
    context = UsdValidation.ValidationContext(
        UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    )
    assert any("ND_" not in e.GetMessage() for e in context.Validate(broken))


def test_a_moved_folder_still_finds_everything(shirt, tmp_path):
    before = tmp_path / "before"
    shutil.copytree(shirt[0].parent, before)
    write_materials(before / "baked", before / "look.usda", PLAIN, scene=before / "shirt.usda")
    before.rename(tmp_path / "after")
    layers, assets, unresolved = UsdUtils.ComputeAllDependencies(
        str(tmp_path / "after" / "look.usda")
    )
    assert not unresolved
    assert {layer.GetDisplayName() for layer in layers} >= {"look.usda", "shirt.usda"}
    assert any(str(a).endswith("Body.base_color.exr") for a in assets)


def test_the_scene_and_the_bake_are_only_read(shirt, tmp_path):
    shutil.copytree(shirt[0].parent, tmp_path / "job")
    scene, baked = tmp_path / "job" / "shirt.usda", tmp_path / "job" / "baked"
    scene.chmod(0o444)
    before = {p: p.read_bytes() for p in (scene, *baked.glob("*.*"))}
    write_materials(baked, tmp_path / "look.usda", PLAIN, scene=scene)
    assert {p: p.read_bytes() for p in (scene, *baked.glob("*.*"))} == before


def test_a_missing_texture_is_told_and_replaced_by_a_constant(shirt, tmp_path, capsys):
    shutil.copytree(shirt[1], tmp_path / "baked")
    (tmp_path / "baked" / "Body.base_color.exr").unlink()
    assert main(["material", str(tmp_path / "baked"), "--no-fit"]) == 1
    assert "Body.base_color.exr is missing" in capsys.readouterr().err
    stage = Usd.Stage.Open(str(tmp_path / "baked" / "look.usda"))
    surface = UsdShade.Shader(stage.GetPrimAtPath("/Garment/FabricLooks/Body_0/Preview"))
    assert tuple(surface.GetInput("diffuseColor").Get()) == pytest.approx((0.5, 0.5, 0.5))


def test_udim_tiles_are_one_texture(tmp_path):
    _, baked = bake_shirt(tmp_path, udim=True)
    write_materials(baked, settings=PLAIN)
    stage = Usd.Stage.Open(str(baked / "look.usda"))
    for node in ("base_color", "normal"):
        shader = UsdShade.Shader(stage.GetPrimAtPath(f"/Garment/FabricLooks/Body_0/{node}"))
        assert ".<UDIM>." in shader.GetInput("file").Get().path
    assert not UsdUtils.ComputeAllDependencies(str(baked / "look.usda"))[2]


def test_a_layer_of_somebody_else_is_not_overwritten(shirt, tmp_path):
    theirs = tmp_path / "look.usda"
    theirs.write_text("#usda 1.0\n")
    with pytest.raises(FabricError, match="did not write"):
        write_materials(shirt[1], theirs, PLAIN)
    assert theirs.read_text() == "#usda 1.0\n"


def test_a_look_of_ours_is_replaced_unless_that_is_forbidden(shirt, tmp_path):
    out = tmp_path / "look.usda"
    write_materials(shirt[1], out, PLAIN)
    write_materials(shirt[1], out, PLAIN)
    with pytest.raises(FabricError, match="no-clobber"):
        write_materials(shirt[1], out, PLAIN, clobber=False)


def test_a_dry_run_writes_nothing(shirt, tmp_path):
    write_materials(shirt[1], tmp_path / "look.usda", PLAIN, dry_run=True)
    assert not list(tmp_path.iterdir())


def test_a_scene_that_changed_is_told(shirt, tmp_path):
    text = shirt[0].read_text().replace("(0.33, 0)", "(0.32, 0)")
    changed = tmp_path / "shirt.usda"
    changed.write_text(text)
    made = write_materials(shirt[1], tmp_path / "look.usda", PLAIN, scene=changed)
    assert any("changed since it was baked" in note for note in made.notes)


BAD = {
    "no folder": (["nowhere"], "is not a folder"),
    "no manifest": (["{empty}"], "has no manifest.json"),
    "broken manifest": (["{broken}"], "has no 'settings' in its root; bake again"),
    "unknown surface": (["{baked}", "--surface", "phong"], "is unknown"),
    "no layer": (["{baked}", "-o", "{empty}/look.txt"], "is not the name of a USD layer"),
    "no such folder for the layer": (["{baked}", "-o", "{empty}/no/look.usda"], "not a folder"),
    "a scene that is no USD": (["{baked}", "--scene", "x.obj"], "is not a USD layer"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line_and_status_2(name, shirt, tmp_path, capsys):
    words, expected = BAD[name]
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "manifest.json").write_text(json.dumps({"garments": {}}))
    (tmp_path / "empty").mkdir()
    known = {"empty": tmp_path / "empty", "broken": broken, "baked": shirt[1]}
    assert main(["material", *(w.format(**known) for w in words)]) == 2
    line = capsys.readouterr().err
    assert expected in line
    assert line.count("\n") == 1

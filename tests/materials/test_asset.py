"""`material --asset`: a garment as layers of one asset, with a variant for each colourway."""

from __future__ import annotations

import shutil

import pytest
from pxr import Kind, Usd, UsdGeom, UsdShade, UsdUtils

from fabricusd.cli.main import main
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import FabricSurface
from tests.materials.scenes import bake_shirt


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    return bake_shirt(tmp_path_factory.mktemp("baked"))[1]


@pytest.fixture(scope="module")
def asset(baked, tmp_path_factory):
    """An asset of two colourways, moved after it was made."""
    folder = tmp_path_factory.mktemp("assets")
    for words in ([], ["--colorway", "Autumn 2"]):
        assert write(baked, folder / "shirt", *words) == 0
    (folder / "shirt").rename(folder / "moved")
    (folder / "moved").rename(folder / "elsewhere")
    return folder / "elsewhere" / "shirt.usda"


def write(baked, where, *words) -> int:
    look = ["-o", str(where.parent / "look.usda")]
    return main(["material", str(baked), "--asset", str(where), *look, "--no-fit", "-q", *words])


def test_the_root_says_what_the_asset_is_before_its_payload_is_loaded(asset):
    stage = Usd.Stage.Open(str(asset), Usd.Stage.LoadNone)
    root = stage.GetDefaultPrim()
    model = Usd.ModelAPI(root)
    assert Kind.Registry.IsA(model.GetKind(), Kind.Tokens.component)
    assert (model.GetAssetName(), model.GetAssetIdentifier().path) == ("shirt", "./shirt.usda")
    assert [p.path for p in model.GetPayloadAssetDependencies()] == ["./payload.usda"]
    assert UsdGeom.ModelAPI(root).GetExtentsHint()[1] == pytest.approx((0.03, 0.01, 0.0))
    assert not root.GetChildren()
    assert root.HasAuthoredPayloads()


def test_each_colourway_binds_its_own_materials_with_its_own_textures(asset):
    stage = Usd.Stage.Open(str(asset))
    root = stage.GetDefaultPrim()
    variants = root.GetVariantSets()
    assert variants.GetVariantSet("colorway").GetVariantNames() == [
        "Autumn_2",
        "linen_plain_velvet",
    ]
    assert variants.GetVariantSelection("colorway") == "linen_plain_velvet"
    for name in ("linen_plain_velvet", "Autumn_2"):
        variants.SetSelection("colorway", name)
        part = stage.GetPrimAtPath("/shirt/geo/Body/lay_0")
        material, _ = UsdShade.MaterialBindingAPI(part).ComputeBoundMaterial()
        assert material.GetPath() == "/shirt/FabricLooks/Body_0"
        node = UsdShade.Shader(stage.GetPrimAtPath(f"{material.GetPath()}/Preview_base_color"))
        file = node.GetInput("file").Get()
        assert file.resolvedPath == str(asset.parent / "textures" / name / "Body.base_color.exr")


def test_the_folder_names_nothing_outside(asset):
    layers, assets, lost = UsdUtils.ComputeAllDependencies(str(asset))
    assert not lost
    named = [layer.realPath for layer in layers] + [str(one) for one in assets]
    assert len(named) > 8
    assert all(name.startswith(f"{asset.parent}/") for name in named)


@pytest.mark.parametrize("variant", ["baked", "procedural"])
def test_the_asset_is_rendered_as_its_variant_says(asset, variant, tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    prim = stage.DefinePrim("/shot")
    prim.GetReferences().AddReference(str(asset))
    prim.GetVariantSets().SetSelection("fabricLook", variant)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    stage.GetRootLayer().Save()
    scene = read_scene(tmp_path / "shot.usda")
    assert scene.notes == []
    [mesh] = scene.meshes
    kinds = {isinstance(scene.materials[k], FabricSurface) for k in mesh.material}
    assert kinds == {variant == "procedural"}


def test_a_colourway_is_replaced_unless_that_is_forbidden(baked, tmp_path, capsys):
    where = tmp_path / "shirt"
    assert write(baked, where) == 0
    assert write(baked, where) == 0
    before = {path: path.read_bytes() for path in where.rglob("*.usd*")}
    capsys.readouterr()
    words = ["-o", str(tmp_path / "other.usda")]
    assert write(baked, where, *words, "--no-clobber") == 2
    assert "has the colourway 'linen_plain_velvet'" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in where.rglob("*.usd*")} == before


def test_another_garment_is_no_colourway(baked, tmp_path, capsys):
    assert write(baked, tmp_path / "shirt") == 0
    shutil.copytree(baked, tmp_path / "other")
    stage = Usd.Stage.Open(str(tmp_path / "other" / "Body.usdc"))
    UsdGeom.Mesh(stage.GetDefaultPrim()).GetPointsAttr().Set([(9, 9, 9)] * 8)
    stage.GetRootLayer().Save()
    capsys.readouterr()
    assert write(tmp_path / "other", tmp_path / "shirt", "--colorway", "red") == 2
    assert "another garment's geometry" in capsys.readouterr().err
    assert not (tmp_path / "shirt" / "colorways" / "red.usda").exists()


def test_a_folder_of_somebody_else_is_left_alone(baked, tmp_path, capsys):
    (tmp_path / "shirt").mkdir()
    (tmp_path / "shirt" / "shirt.usda").write_text("#usda 1.0\n")
    assert write(baked, tmp_path / "shirt") == 2
    line = capsys.readouterr().err
    assert "not an asset of fabricusd" in line
    assert line.count("\n") == 1
    assert [path.name for path in (tmp_path / "shirt").iterdir()] == ["shirt.usda"]

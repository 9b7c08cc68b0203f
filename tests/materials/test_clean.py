"""Whatever a command writes: our rules, USD's validators and MaterialX's find nothing in it."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import MaterialX as mx
import pytest
from pxr import Sdf, Usd, UsdShade, UsdUtils, UsdValidation

from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings as BakeSettings
from fabricusd.cli.main import main
from fabricusd.images.files import shape_of
from fabricusd.schema import check
from tests.conftest import CHECKOUT
from tests.materials.scenes import MAPS, bake_shirt
from tests.materials.studio import write_shot

USD = (".usd", ".usda", ".usdc", ".usdz")

NOT_IN_THE_WHEEL = "MissingShaderIdInRegistry"
"""MaterialX's nodes: usd-core's wheel holds no definitions of them."""


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    """A folder of everything: samples, presets, bakes, looks, packages, assets."""
    folder = tmp_path_factory.mktemp("written")
    sys.path.insert(0, str(CHECKOUT / "samples"))
    import make_samples

    (folder / "samples").mkdir()
    make_samples.fitted_looks = lambda fabric: None  # minutes, and numbers alone
    make_samples.make_cylinders(folder / "samples")
    make_samples.make_drape(folder / "samples", cells=8, factor=1, steps=2)
    make_samples.make_skirt(folder / "samples", around=24, down=8, steps=2)
    import lit_from_behind

    lit_from_behind.make_lit_drape(folder / "samples", cells=8, factor=1, steps=2)
    lit_from_behind.make_lit_skirt(folder / "samples", around=24, down=8, steps=2)
    lit_from_behind.make_curtain(folder / "samples", across=24, up=4)
    assert main(["demo", "-o", str(folder / "demo"), "--quiet"]) == 0
    bake_shirt(folder)
    bake(
        write_shot(folder / "shot.usda"), folder / "shot_baked",
        BakeSettings(resolution=64, maps=MAPS), workers=1,
    )  # fmt: skip
    for name, words in LOOKS.items():
        told = [str(folder / w) if (folder / w).exists() else w for w in words]
        where = ["-o", str(folder / f"{name}.usda"), "--usdz", str(folder / f"{name}.usdz")]
        where += ["--usdz-web", str(folder / f"{name}_web.usdz")]
        where += ["--asset", str(folder / f"{name}_asset")]
        assert main(["material", *told, *where, "--no-fit", "--quiet"]) == 0
    return folder


LOOKS = {
    "over": ["baked", "--scene", "shirt.usda"],
    "alone": ["baked", "--surface", "gltf_pbr", "hair"],
    "instanced": ["shot_baked", "--scene", "shot.usda", "--surface", "standard_surface"],
}


def layers(folder: Path) -> Iterator[Path]:
    """Every USD file below a folder, once more for each variant of a look."""
    for path in sorted(folder.rglob("*")):
        if path.suffix not in USD:
            continue
        yield path
        stage = Usd.Stage.Open(str(path))
        root = stage.GetDefaultPrim()
        looks = root.GetVariantSet("fabricLook") if root else None
        for name in looks.GetVariantNames() if looks else ():
            looks.SetVariantSelection(name)
            other = path.with_name(f"{path.stem}.{name}.usda")
            stage.GetRootLayer().Export(str(other))
            yield other
            other.unlink()
            stage.Reload()


def test_no_rule_and_no_validator_finds_anything(written):
    context = UsdValidation.ValidationContext(
        UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    )
    found, names = [], set()
    for path in layers(written):
        names.add(path.name)
        found += [str(finding) for finding in check(str(path))]
        stage = Usd.Stage.Open(str(path))
        found += [
            f"{path.name}: {error.GetName()} {error.GetMessage()}"
            for error in context.Validate(stage)
            if error.GetName() != NOT_IN_THE_WHEEL
        ]
    assert found == []
    wanted = {"drape.usda", "skirt.usda", "linen_plain.usda", "Body.usdc", "fabrics.usda"}
    for name in LOOKS:
        variants = ("baked", "procedural", "off")
        wanted |= {f"{name}.usda", *(f"{name}.{variant}.usda" for variant in variants)}
        wanted |= {f"{name}.usdz", f"{name}_web.usdz", f"{name}_asset.usda", "payload.usda"}
    assert wanted <= names


def test_materialx_validates_every_document(written):
    documents = sorted(written.rglob("*.mtlx"))
    assert len(documents) == len(LOOKS)
    for path in documents:
        document = mx.createDocument()
        mx.readFromXmlFile(document, str(path))
        assert document.validate() == (True, ""), path


def test_a_validator_would_find_a_fault(written):
    """The twin that bites: a wrong bias of a normal map, and a rule of ours."""
    stage = Usd.Stage.Open(str(written / "over.usda"))
    node = UsdShade.Shader(stage.GetPrimAtPath("/Shirt/FabricLooks/Body_0/Preview_normal"))
    node.GetInput("bias").Set((0, 0, 0, 0))
    material = stage.GetPrimAtPath("/Shirt/FabricLooks/Body_0_plain")
    material.GetRelationship("fabric:binding").SetTargets(["/Shirt"])
    context = UsdValidation.ValidationContext(
        UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    )
    found = {error.GetName() for error in context.Validate(stage)}
    assert {"BindingNamesAFabric", "NonCompliantBiasValues"} <= found


def textures(path: Path) -> dict[str, set[tuple[str, str, str]]]:
    """By kind of node, (file's ending, sourceColorSpace, colour space) of each texture."""
    found: dict[str, set[tuple[str, str, str]]] = {}
    stage = Usd.Stage.Open(str(path))
    for prim in stage.Traverse():
        shader = UsdShade.Shader(prim)
        given = shader.GetInput("file") if prim.IsA(UsdShade.Shader) else None
        if given:
            space = shader.GetInput("sourceColorSpace")
            row = (
                Path(given.Get().path).suffix,
                space.Get() if space else "",
                given.GetAttr().GetColorSpace(),
            )
            found.setdefault(shader.GetIdAttr().Get(), set()).add(row)
    return found


def test_textures_name_colour_spaces_that_their_readers_know(written):
    assert textures(written / "over.usda") == {
        "UsdUVTexture": {(".exr", "raw", "lin_rec709_scene"), (".exr", "raw", "raw"),
                         (".png", "raw", "raw")},
        "ND_image_color3": {(".exr", "", "lin_rec709")},
        "ND_image_float": {(".exr", "", "raw")},
        "ND_image_vector3": {(".exr", "", "raw"), (".png", "", "raw")},
    }  # fmt: skip
    assert textures(written / "over_web.usdz") == {
        "UsdUVTexture": {(".png", "sRGB", "srgb_rec709_scene"), (".png", "raw", "raw")}
    }


@pytest.mark.parametrize("name", LOOKS)
@pytest.mark.parametrize("tail", ["", "_web"])
def test_a_package_is_the_garment_and_names_nothing_outside(name, tail, written):
    path = written / f"{name}{tail}.usdz"
    stage = Usd.Stage.Open(str(path))
    text = stage.GetRootLayer().ExportToString()
    for word in ("fabric:", "thread:", "Woven", str(written), "collection:", "references", "@../"):
        assert word not in text, word
    kinds = {p.GetTypeName() for p in stage.TraverseAll()}
    assert kinds <= {"Xform", "Mesh", "GeomSubset", "Scope", "Material", "Shader", ""}
    assert not UsdUtils.ComputeAllDependencies(str(path))[2]
    assert not stage.GetPrimAtPath("/Shirt/Hanger")


def test_a_package_of_the_web_holds_pictures_of_eight_bits(written, tmp_path):
    package = Sdf.ZipFile.Open(str(written / "over_web.usdz"))
    pictures = [name for name in package.GetFileNames() if not name.endswith(".usdc")]
    assert {Path(name).suffix for name in pictures} == {".png"}
    for name in pictures:
        picture = tmp_path / Path(name).name
        picture.write_bytes(package.GetFile(name))
        # Maps that shape reflections are the mean of a lay.
        side = 1 if re.search(r"\.lay\d+\.", Path(name).name) else 64
        assert shape_of(picture)[:2] == (side, side)
        assert picture.read_bytes()[24] == 8  # bits a channel, by the PNG specification


def test_udim_tiles_in_a_package_are_told(tmp_path, capsys):
    _, baked = bake_shirt(tmp_path, udim=True)
    words = ["material", str(baked), "--no-fit", "--usdz-web", str(tmp_path / "web.usdz")]
    assert main(words) == 1
    assert "has UDIM tiles" in capsys.readouterr().err


def test_a_gap_reflects_nothing(written):
    stage = Usd.Stage.Open(str(written / "over.usda"))
    modes = {
        name: UsdShade.Shader(stage.GetPrimAtPath(f"/Shirt/FabricLooks/{name}/Preview"))
        .GetInput("opacityMode")
        for name in ("Body_0", "Body_1")
    }  # fmt: skip
    assert modes["Body_0"].Get() == "presence"
    assert not modes["Body_1"]  # velvet has no gaps


def test_materials_say_of_which_materialx_they_are(written):
    stage = Usd.Stage.Open(str(written / "over.usda"))
    prim = stage.GetPrimAtPath("/Shirt/FabricLooks/Body_0")
    assert "MaterialXConfigAPI" in prim.GetMetadata("apiSchemas").GetAppliedItems()
    assert prim.GetAttribute("config:mtlx:version").Get() == "1.39"


def test_a_look_has_a_name_of_its_own(written, tmp_path):
    garment = Usd.Stage.Open(str(written / "shirt.usda"))
    model = Usd.ModelAPI(garment.GetDefaultPrim())
    model.SetAssetIdentifier("studio://shirt")
    model.SetAssetName("shirt")
    model.SetAssetVersion("7")
    garment.GetRootLayer().Export(str(tmp_path / "shirt.usda"))
    garment.Reload()
    words = ["material", str(written / "baked"), "--scene", str(tmp_path / "shirt.usda")]
    assert main([*words, "-o", str(tmp_path / "look.usda"), "--no-fit", "--quiet"]) == 0
    stage = Usd.Stage.Open(str(tmp_path / "look.usda"))
    look = Usd.ModelAPI(stage.GetDefaultPrim())
    assert look.GetAssetIdentifier().path == "./look.usda"
    assert (look.GetAssetName(), look.GetAssetVersion()) == ("look", "")

"""What else a look is written as: USDZ, U3M, OSL; and a reader that is not Pixar's."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import partial

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Usd, UsdGeom, UsdShade, UsdUtils

from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.shadow.mean import node_means
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.weave.quadrature import curve_nodes
from fabricusd.cli.main import main
from fabricusd.errors import FabricError
from fabricusd.materials.materials import write_materials
from fabricusd.materials.recipes import Settings
from fabricusd.materials.targets.osl import osl_source
from fabricusd.materials.targets.package import write_usdz
from fabricusd.materials.targets.u3m import construction, physics, write_u3m
from fabricusd.schema import load
from tests.materials.scenes import bake_shirt


@pytest.fixture(scope="module")
def packed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("packed")
    _, baked = bake_shirt(folder)
    targets = {"usdz": folder / "shirt.usdz", "usdz-web": folder / "web.usdz", "osl": None}
    settings = Settings(fitted=False, targets=targets)
    return write_materials(baked, folder / "look.usda", settings), folder / "shirt.usdz"


def test_a_package_holds_the_baked_variant_and_its_textures_alone(packed):
    stage = Usd.Stage.Open(str(packed[1]))
    assert not UsdUtils.ComputeAllDependencies(str(packed[1]))[2]
    names = {p.GetName() for p in stage.Traverse() if p.IsA(UsdShade.Material)}
    assert names == {"Body_0", "Body_1"}
    assert not [p for p in stage.Traverse() if p.GetTypeName() == "WovenFabric"]
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Subset):
            assert UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]


def test_another_usd_reader_finds_geometry_uvs_and_textures(packed):
    tinyusdz = pytest.importorskip("tinyusdz")
    from tinyusdz import tydra

    web = packed[1].with_name("web.usdz")
    scene = tydra.convert_to_render_scene(tinyusdz.load(str(web)))
    (mesh,) = scene.meshes()
    assert mesh.texcoord_slot_ids() == [0]
    assert len(scene.textures()) >= 3
    assert {t.varname_uv for t in scene.textures()} == {"st"}
    assert any("base_color.png" in i.asset_identifier for i in scene.images())
    assert all(m.has_preview_surface for m in scene.materials())


def test_a_package_with_another_suffix_or_a_missing_texture_is_refused(packed, tmp_path):
    look = packed[1].with_name("look.usda")
    with pytest.raises(FabricError, match="end in"):
        write_usdz(look, tmp_path / "shirt.zip")
    broken = tmp_path / "look.usda"
    stage = Usd.Stage.Open(str(look))
    stage.GetRootLayer().Export(str(broken))
    with pytest.raises(FabricError, match="does not exist"):
        write_usdz(broken, tmp_path / "shirt.usdz")
    assert not list(tmp_path.glob("*.usdz"))


def test_the_shader_carries_the_fabric_as_its_defaults(packed):
    found = [p for p in packed[0].files if p.suffix == ".osl"]
    assert sorted(p.name for p in found) == ["look.linen_plain.osl", "look.velvet.osl"]
    text = found[0].read_text()
    linen = load("linen_plain").thread_list[0]
    tables = dict(re.findall(r"(\w+)\[\d+\] = \{(.*)\}", text))
    numbers = {k: np.array([float(x) for x in v.split(",")]) for k, v in tables.items()}
    assert np.allclose(numbers["thread_albedo"], linen.albedo)
    assert np.allclose(numbers["thread_gamma_surface"], linen.gamma_surface)
    gap = float(re.search(r"gap = ([\d.e-]+)", text).group(1))
    assert numbers["node_weight"].sum() + gap == pytest.approx(1.0)
    assert f"open = {gap:.9g}," in text
    assert "open = 0," in osl_source(replace(load("linen_plain"), opaque=True))
    assert len(numbers["node_angle"]) == int(re.search(r"node_count = (\d+)", text).group(1))


def test_a_model_that_the_shader_lacks_is_refused():
    with pytest.raises(FabricError, match="'microcylinder'"):
        osl_source(replace(load("linen_plain"), model="thesis"))


def test_osl_has_the_law_s_mean_shadow_at_directions_that_it_keeps():
    fabric = load("linen_plain")
    said = osl_source(fabric)
    (numbers,) = re.findall(r"float means\[\d+\] = \{(.*?)\}", said)
    shadow = compile_shadow(fabric, "horizon", precision=np.float64)
    nodes = curve_nodes(fabric)
    whole = node_means(shadow, nodes, fabric)
    kept = np.array(numbers.split(","), float).reshape(17, 17, len(nodes.psi0))
    assert "int columns = 16," in said
    assert "int elevations = 17," in said
    assert np.allclose(kept, whole[::16, ::6], rtol=1e-3, atol=1e-5)


def test_osl_has_what_is_seen_at_the_views_that_it_keeps():
    fabric = replace(load("silk_shot"), surface_law="visible")
    said = osl_source(fabric)
    shadow = compile_shadow(fabric, "horizon", precision=np.float64)
    shares = surface_tables(fabric, shadow=shadow).shares.reshape(65, 33, 8)
    (numbers,) = re.findall(r"float shares\[\d+\] = \{(.*?)\}", said)
    kept = np.array(numbers.split(","), float).reshape(17, 17, 8)
    assert "int law = 3," in said
    assert "#define VISIBLE 3" in said
    assert np.allclose(kept, shares[::4, ::2], rtol=1e-4, atol=1e-7)
    assert np.abs(kept[..., 1:4]).max() > 0.1


# The keys that version 1.1 of the schema requires of a side, and nothing else is allowed.
VISUAL = {
    "alpha", "anisotropy_value", "anisotropy_rotation", "clearcoat_value", "clearcoat_normal",
    "clearcoat_roughness", "ior", "metalness", "normal", "displacement", "roughness",
    "sheen_value", "sheen_tint", "specular_value", "specular_tint", "subsurface_radius",
    "subsurface_value", "transmission", "basecolor", "subsurface_color", "shader", "preview",
}  # fmt: skip


@pytest.fixture(scope="module")
def swatch(tmp_path_factory):
    path = tmp_path_factory.mktemp("u3m") / "linen.u3m"
    files = write_u3m(load("linen_plain"), path, resolution=64, fitted=False)
    return json.loads(path.read_text()), path, files


def test_a_swatch_has_every_key_of_the_schema_and_its_size_in_millimetres(swatch):
    said, _, _ = swatch
    assert said["schema"] == "1.1"
    assert set(said["material"]["front"]) == VISUAL
    image = said["material"]["front"]["basecolor"]["texture"]["image"]
    fabric = load("linen_plain")
    assert image["width"] % (1e3 * fabric.weave.ends * fabric.warp.pitch) == pytest.approx(0.0)
    assert image["dpi"]["x"] == pytest.approx(64 / image["width"] * 25.4)
    assert re.fullmatch(r"[0-9a-f-]{14}4[0-9a-f]{3}-[89ab].*", said["material"]["id"])


def test_its_pictures_are_sixteen_bit_rgb_beside_it(swatch):
    said, path, files = swatch
    for entry in said["material"]["front"].values():
        texture = entry.get("texture") if isinstance(entry, dict) else None
        if texture:
            picture = path.parent / texture["image"]["path"]
            spec = oiio.ImageBuf(str(picture)).spec()
            assert (spec.width, spec.nchannels, str(spec.format)) == (64, 3, "uint16")
            assert picture in files


@pytest.mark.parametrize(
    ("preset", "kind", "fibre"),
    [
        ("linen_plain", "Plain weave", "Linen"),
        ("polyester_satin_charmeuse", "Satin", "Polyester"),
        ("silk_shot", "Plain weave", "Silk"),
        ("velvet", "Velour", "unknown"),
    ],
)
def test_construction_and_fibre_are_the_formats_words(preset, kind, fibre):
    fabric = load(preset)
    assert construction(fabric) == {"type": kind, "name": None}
    assert physics(fabric)["composition"]["parts"][0]["type"] == fibre


def test_the_command_writes_them_all_and_makes_their_folder(packed, tmp_path, capsys, monkeypatch):
    small = partial(write_u3m, resolution=64)
    monkeypatch.setattr("fabricusd.materials.targets.u3m.write_u3m", small)
    words = ["material", str(packed[1].with_name("baked")), "-o", str(tmp_path / "look.usda")]
    assert main([*words, "--no-fit", "--u3m", str(tmp_path / "cad")]) == 0
    printed = capsys.readouterr().out.split()
    assert str(tmp_path / "cad" / "velvet.u3m") in printed
    assert str(tmp_path / "cad" / "velvet.u3ma") in printed
    assert all((tmp_path / p).exists() for p in printed)

"""The garment as binary glTF: what is in the file, and what its readers find."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings as BakeSettings
from fabricusd.cli.main import main
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding
from fabricusd.images.files import read_mip_level
from fabricusd.materials.materials import write_materials
from fabricusd.materials.recipes import Settings
from fabricusd.materials.targets.gltf import glb
from fabricusd.scene.read import read_scene
from fabricusd.schema import load, write_binding, write_fabric
from fabricusd.srgb import srgb_encode
from tests.materials.scenes import MAPS, bake_shirt
from tests.materials.targets.gltf.files import GlbFile
from tests.reference.stages import bind_fabric, new_stage, square

pytest.importorskip("pygltflib")


def written(baked, where, *, scene=None, fitted=False):
    """The file of a bake, and what was said."""
    settings = Settings(fitted=fitted, targets={"glb": where})
    made = write_materials(baked, where.with_suffix(".usda"), settings, scene=scene)
    assert where in made.files
    return GlbFile(where), made


@pytest.fixture(scope="module")
def shirt(tmp_path_factory):
    return bake_shirt(tmp_path_factory.mktemp("shirt"))


@pytest.fixture(scope="module")
def over(shirt, tmp_path_factory):
    """The file of a look over the scene."""
    where = tmp_path_factory.mktemp("over") / "shirt.glb"
    written(shirt[1], where, scene=shirt[0])
    return where


@pytest.fixture(scope="module")
def cloths(tmp_path_factory):
    """The files of every kind of cloth that there is a rule for, by name."""
    found = {}
    for name, fabric in (
        ("satin", load("polyester_satin_charmeuse")),
        ("conserving", replace(load("linen_plain"), model="conserving", back=None)),
    ):
        folder = tmp_path_factory.mktemp(name)
        stage = new_stage(folder)
        mesh = square(stage)
        write_fabric(stage, "/Looks/Cloth", fabric)
        write_binding(
            mesh.GetPrim(), "/Looks/Cloth", Binding(fabric=fabric, threads_per_uv=(24.0, 24.0))
        )
        stage.GetRootLayer().Save()
        maps = (*MAPS, *(("transmission_color",) if name == "conserving" else ()))
        bake(
            folder / "scene.usda", folder / name, BakeSettings(resolution=64, maps=maps), workers=1
        )
        found[name] = folder / f"{name}.glb"
        written(folder / name, found[name], fitted=name == "satin")
    return found


def extensions_in(said):
    """Every extension that an object of the file has."""
    found = set()
    waiting = [said]
    while waiting:
        one = waiting.pop()
        if isinstance(one, dict):
            found |= set(one.get("extensions", {}))
            waiting += one.values()
        elif isinstance(one, list):
            waiting += one
    return found


@pytest.mark.parametrize("which", ["over", "satin", "conserving"])
def test_the_file_holds_what_it_says_and_requires_no_extension(which, over, cloths):
    file = GlbFile(over if which == "over" else cloths[which])
    said = file.said
    assert set(said["extensionsUsed"]) == extensions_in(said)
    assert "extensionsRequired" not in said
    for image in said["images"]:
        assert image["mimeType"] == "image/png"
        assert file.view(image["bufferView"]).startswith(b"\x89PNG")
    assert all(one["doubleSided"] for one in said["materials"])
    variants = said["extensions"]["KHR_materials_variants"]["variants"]
    for attributes, triangles, one in file.primitives():
        position, normal, tangent = (attributes[k] for k in ("POSITION", "NORMAL", "TANGENT"))
        bounds = said["accessors"][one["attributes"]["POSITION"]]
        assert np.array_equal(position.min(axis=0), np.float32(bounds["min"]))
        assert np.array_equal(position.max(axis=0), np.float32(bounds["max"]))
        assert triangles.max() == len(position) - 1
        assert np.isin(tangent[:, 3], (-1.0, 1.0)).all()
        assert np.allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-5)
        assert np.allclose(np.linalg.norm(tangent[:, :3], axis=1), 1.0, atol=1e-5)
        assert np.allclose((normal * tangent[:, :3]).sum(axis=1), 0.0, atol=1e-5)
        mappings = one["extensions"]["KHR_materials_variants"]["mappings"]
        listed = sorted(k for mapping in mappings for k in mapping["variants"])
        assert listed == list(range(len(variants)))
        assert all(0 <= m["material"] < len(said["materials"]) for m in mappings)


def test_the_variants_are_those_of_the_look_and_off_is_the_scenes_own_material(over, cloths):
    def names(file):
        return [v["name"] for v in file.said["extensions"]["KHR_materials_variants"]["variants"]]

    file = GlbFile(over)
    assert names(file) == ["baked", "procedural", "off"]
    assert file.material("Old")["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx(
        (0.18, 0.18, 0.18, 1.0)
    )
    (linen, velvet) = file.primitives()
    assert file.said["materials"][linen[2]["material"]]["name"] == "Body_0"
    assert file.said["materials"][velvet[2]["material"]]["name"] == "Body_1"
    assert names(GlbFile(cloths["satin"])) == ["baked", "procedural"]
    assert names(GlbFile(cloths["conserving"])) == ["baked", "baked_translucent", "procedural"]


def test_light_comes_through_in_a_variant_of_its_own_and_the_rest_is_for_every_reader(cloths):
    file = GlbFile(cloths["conserving"])
    key = "KHR_materials_diffuse_transmission"
    with_it = [one["name"] for one in file.said["materials"] if key in one.get("extensions", {})]
    assert with_it == ["square_translucent"]
    told = file.material("square_translucent")["extensions"][key]
    assert told["diffuseTransmissionTexture"] == told["diffuseTransmissionColorTexture"]
    assert key in file.said["extensionsUsed"]


def test_textures_hold_the_numbers_of_the_bake(cloths, tmp_path):
    file = GlbFile(cloths["satin"])
    look = json.loads(cloths["satin"].with_suffix(".json").read_text())
    (fits,) = look["fits"].values()
    fit = fits["gltf_pbr"]["parameters"]
    material = file.material("square")
    extensions = material["extensions"]
    assert extensions["KHR_materials_ior"]["ior"] == pytest.approx(fit["specular_ior"])

    def picture(reference):
        image = file.said["images"][file.said["textures"][reference["index"]]["source"]]
        (tmp_path / "a.png").write_bytes(file.view(image["bufferView"]))
        return read_mip_level(tmp_path / "a.png")

    def baked(name):
        return read_mip_level(cloths["satin"].parent / "satin" / f"square.{name}.exr")

    def mean(name):
        # 64 texels for 24 threads do not resolve them: the look has the mean of the cloth.
        maps = cloths["satin"].with_name(f"{cloths['satin'].stem}_maps")
        (file,) = cloths["satin"].parent.glob(f"**/{maps.name}/square.{name}.lay0.exr")
        return read_mip_level(file)[0, 0]

    pbr = material["pbrMetallicRoughness"]
    color = np.clip(baked("base_color") * fit["base_color_scale"], 0, 1)
    assert np.abs(picture(pbr["baseColorTexture"])[..., :3] - srgb_encode(color)).max() < 0.003
    smooth = float(np.clip((mean("roughness_along") * fit["smooth_scale"]) ** 2, 0, 1)[0])
    rough = float(np.clip((mean("roughness_across") * fit["rough_scale"]) ** 2, 0, 1)[0])
    back = pbr["roughnessFactor"] ** 2
    assert back == pytest.approx(smooth, abs=0.003)
    assert pbr["metallicFactor"] == 0.0
    anisotropy = extensions["KHR_materials_anisotropy"]
    back = back + (1 - back) * anisotropy["anisotropyStrength"] ** 2
    assert back == pytest.approx(max(rough, smooth), abs=0.02)
    turn = anisotropy["anisotropyRotation"]
    tangent = mean("tangent")[:2]
    assert np.cos(turn) * tangent[0] + np.sin(turn) * tangent[1] == pytest.approx(0, abs=0.02)
    if "normalTexture" in material:
        normal = picture(material["normalTexture"])
        assert np.abs(normal - (0.5 * mean("normal") + 0.5)).max() < 0.003


def test_the_garment_is_as_large_as_in_the_scene_and_y_is_up(shirt, over, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    # The button wears no fabric. The scene is in centimetres with z up, in the plane z = 0.
    for where in (over, tmp_path / "alone.glb"):
        if where != over:
            written(shirt[1], where)
        read = trimesh.load(where, force="mesh")
        assert read.area == pytest.approx(2e-4, rel=1e-5)
        assert np.allclose(read.extents, (0.02, 0.0, 0.01), atol=1e-7)
        meshes = read_scene(where, fabric=load("linen_plain")).meshes
        points = np.concatenate([one.points[one.triangles] for one in meshes])
        twice = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        assert twice[:, 1].sum() == pytest.approx(4e-4, rel=1e-5)


def test_copies_of_a_mesh_are_all_there_with_the_scene_and_noted_without(tmp_path):
    stage = new_stage(tmp_path)
    for path, place in (("/Left", (0, 0, 0)), ("/Right", (5, 1, 0))):
        mesh = square(stage, path)
        UsdGeom.XformCommonAPI(mesh).SetTranslate(place)
        bind_fabric(stage, mesh.GetPrim())
    stage.GetRootLayer().Save()
    scene = tmp_path / "scene.usda"
    bake(scene, tmp_path / "b", BakeSettings(resolution=64, maps=MAPS), workers=1)
    file, made = written(tmp_path / "b", tmp_path / "two.glb", scene=scene)
    assert [one["name"] for one in file.said["nodes"]] == ["Left", "Right"]
    places = [attributes["POSITION"].mean(axis=0) for attributes, _, _ in file.primitives()]
    assert np.allclose(places, [(0, 0, 0), (5, 1, 0)])
    assert made.notes == []
    file, made = written(tmp_path / "b", tmp_path / "one.glb")
    assert len(file.said["nodes"]) == 1
    assert "--scene" in made.notes[0]


def test_each_tile_of_a_udim_has_a_material_of_its_own_and_what_crosses_tiles_is_noted(tmp_path):
    _, baked = bake_shirt(tmp_path, udim=True)
    file, made = written(baked, tmp_path / "tiles.glb")
    names = [one["name"] for one in file.said["materials"]]
    assert {"Body_0_1001", "Body_1_1001"} <= set(names)
    # The velvet's face lies from 0.6 to 1.2.
    (note,) = made.notes
    assert "2 triangles that cross" in note


def test_bad_names_and_a_missing_library_are_refused_in_one_line(tmp_path, monkeypatch, shirt):
    with pytest.raises(FabricError, match=r"must be \.glb"):
        glb.check(tmp_path / "shirt.gltf", True)
    monkeypatch.setitem(sys.modules, "pygltflib", None)
    with pytest.raises(FabricError, match=r"fabricusd\[gltf\]"):
        glb.check(tmp_path / "shirt.glb", True)
    assert not list(tmp_path.iterdir())


def test_a_bake_that_lost_its_mesh_is_refused_without_a_scene(shirt, tmp_path):
    baked = tmp_path / "baked"
    shutil.copytree(shirt[1], baked)
    settings = Settings(fitted=False, targets={"glb": tmp_path / "shirt.glb"})
    (baked / "Body.usdc").unlink()
    with pytest.raises(FabricError, match="--scene"):
        write_materials(baked, tmp_path / "look.usda", settings)
    assert not (tmp_path / "shirt.glb").exists()


def test_the_command_writes_it(shirt, tmp_path, capsys):
    where = tmp_path / "shirt.glb"
    words = ["material", str(shirt[1]), "-o", str(tmp_path / "look.usda"), "--no-fit"]
    assert main([*words, "--glb", str(where)]) == 0
    said = capsys.readouterr()
    assert str(where) in said.out.split()
    assert "writing shirt.glb" in said.err
    assert Usd.Stage.Open(str(tmp_path / "look.usda"))


SCRIPT = """
const validator = require('gltf-validator');
const data = new Uint8Array(require('fs').readFileSync(process.argv[1]));
validator.validateBytes(data).then((report) => console.log(JSON.stringify(report.issues)));
"""


@pytest.mark.parametrize("which", ["over", "satin", "conserving"])
def test_the_validator_of_khronos_finds_no_fault(which, over, cloths):
    """Runs where Node.js finds the npm package gltf-validator, for example by NODE_PATH."""
    node = shutil.which("node")
    found = node and subprocess.run([node, "-e", "require('gltf-validator')"], capture_output=True)
    if not found or found.returncode:
        pytest.skip("there is no gltf-validator")
    where = over if which == "over" else cloths[which]
    done = subprocess.run([node, "-e", SCRIPT, str(where)], capture_output=True, check=True)
    issues = json.loads(done.stdout)
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]

"""A garment by payload, variant, instance, collection and material: rendered, baked, dressed."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdShade

from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings as BakeSettings
from fabricusd.images.files import read_image
from fabricusd.materials.materials import write_materials
from fabricusd.materials.recipes import Settings
from fabricusd.reference.render import render
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import FabricSurface
from fabricusd.schema import check
from tests.materials.scenes import MAPS
from tests.materials.studio import write_shot

BINDINGS = {"plain": {}, "strong": {"strong": True}, "of the full purpose": {"purpose": "full"}}


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    scene = write_shot(tmp_path_factory.mktemp("shot") / "shot.usda")
    baked = scene.with_name("baked")
    bake(scene, baked, BakeSettings(resolution=64, maps=MAPS), workers=1)
    return scene, baked


@pytest.mark.parametrize("name", BINDINGS)
def test_both_instances_wear_the_fabric_of_the_material(name, tmp_path):
    scene = read_scene(write_shot(tmp_path / "shot.usda", **BINDINGS[name]))
    assert scene.notes == []
    assert [m.path for m in scene.meshes] == ["/World/One/Body", "/World/Two/Body"]
    for mesh in scene.meshes:
        surface = scene.materials[mesh.material[0]]
        assert isinstance(surface, FabricSurface)
        assert surface.binding.threads_per_uv == (24.0, 24.0)
        assert len(mesh.triangles) == 4


def test_the_shot_and_its_look_are_clean(shot, tmp_path):
    assert check(str(shot[0])) == []
    write_materials(shot[1], tmp_path / "look.usda", Settings(fitted=False), scene=shot[0])
    assert check(str(tmp_path / "look.usda")) == []


def test_every_context_resolves_to_a_surface(shot):
    stage = Usd.Stage.Open(str(shot[0]))
    mesh = stage.GetPrimAtPath("/World/One/Body")
    material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
    found = {
        context: material.ComputeSurfaceSource(context)[0].GetIdAttr().Get()
        for context in ("", "mtlx")
    }
    assert found == {"": "UsdPreviewSurface", "mtlx": "ND_open_pbr_surface_surfaceshader"}


@pytest.mark.parametrize("name", BINDINGS)
def test_each_instance_gets_its_look(name, shot, tmp_path):
    scene = write_shot(tmp_path / "shot.usda", **BINDINGS[name])
    made = write_materials(shot[1], tmp_path / "look.usda", Settings(fitted=False), scene=scene)
    assert made.notes == []
    stage = Usd.Stage.Open(str(tmp_path / "look.usda"))
    kinds = {}
    for variant in ("baked", "procedural"):
        stage.GetDefaultPrim().GetVariantSets().SetSelection("fabricLook", variant)
        path = tmp_path / f"{variant}.usda"
        stage.GetRootLayer().Export(str(path))
        found = read_scene(path)
        assert len(found.meshes) == 2
        kinds[variant] = {found.materials[m.material[0]].name for m in found.meshes}
    assert kinds == {"baked": {"/World/FabricLooks/Body"}, "procedural": {"linen_plain"}}


@pytest.mark.exhaustive
def test_the_look_looks_like_the_fabric(shot, tmp_path):
    look = tmp_path / "look.usda"
    write_materials(shot[1], look, Settings(), scene=shot[0])
    means = []
    for path in (shot[0], look):
        render(path, tmp_path / "a.exr", width=32, height=32, spp=16, level="far")
        picture = read_image(str(tmp_path / "a.exr"), color_space="raw", most=32)
        means.append(picture[12:20, 4:28, :3].mean(axis=(0, 1)))
    assert means[0].min() > 0.05
    # Under an even sky a fitted look is as bright as the cloth, to the fit's own error.
    assert np.abs(means[1] / means[0] - 1.0).max() < 0.25

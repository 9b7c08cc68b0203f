"""Looks of cloth that light comes through: what its surfaces transmit, and what a tracer shows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from fabricusd.appearance import surface
from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings as BakeSettings
from fabricusd.fabric import Binding, Fabric, even
from fabricusd.materials.fit.fit import fit
from fabricusd.materials.fit.forward import forward_through, frames_of
from fabricusd.materials.fit.judge import albedo, direction_pairs, hemisphere
from fabricusd.materials.fit.models import KINDS, transmitted
from fabricusd.materials.materials import write_materials
from fabricusd.materials.networks.graph import Value
from fabricusd.materials.recipes import NEUTRAL, Settings
from fabricusd.materials.uniform import (
    fitted_looks,
    mean_sample,
    mean_values,
    write_fabric_material,
)
from fabricusd.quality.pictures import difference
from fabricusd.reference.render import render_scene
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import Scene
from fabricusd.schema import load, write_binding, write_fabric
from tests.materials.scenes import MAPS
from tests.materials.test_models import white

SIZE = 48


def conserving(preset: str) -> Fabric:
    return replace(even(load(preset)), model="conserving")


@pytest.mark.parametrize("kind", KINDS)
def test_what_comes_through_and_what_the_layers_reflect_is_all_light(kind):
    wi = hemisphere(20000) * (1.0, 1.0, -1.0)
    clear = replace(white(ior=1.0, alpha=(0.5, 0.5)), base=np.zeros((1, 3)))
    view = np.broadcast_to((0.6, 0.0, 0.8), wi.shape)
    through = transmitted(kind, clear, np.ones(3), wi, view).mean(axis=0) * 2 * np.pi
    assert through == pytest.approx(np.ones(3), abs=0.02)
    assert not transmitted(kind, clear, np.ones(3), -wi, view).any()
    glossy = transmitted(kind, white(ior=1.8), np.ones(3), wi, view).mean(axis=0) * 2 * np.pi
    assert np.all(glossy < through - 0.03)


def write_screen(path: Path, fabric: Fabric) -> Path:
    """An upright square of cloth, 24 threads a metre: a lamp behind it, a faint sky, a camera."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/Cloth").GetPrim())
    mesh = UsdGeom.Mesh.Define(stage, "/Cloth/Mesh")
    mesh.CreatePointsAttr([(x, y, 0) for y in (0, 1) for x in (0, 1)])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 3, 2])
    mesh.CreateSubdivisionSchemeAttr("none")
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
    )
    st.Set([(0, 0), (1, 0), (1, 1), (0, 1)])
    write_fabric(stage, "/Cloth/Fabric", fabric)
    binding = Binding(fabric=fabric, threads_per_uv=(24.0, 24.0))
    write_binding(mesh.GetPrim(), "/Cloth/Fabric", binding)
    lamp = UsdLux.RectLight.Define(stage, "/Cloth/Lamp")
    lamp.CreateIntensityAttr(6.0)
    frame = UsdGeom.Xformable(lamp)
    frame.AddTranslateOp().Set(Gf.Vec3d(0.3, 0.8, -1.2))
    frame.AddRotateXOp().Set(180.0)
    UsdLux.DomeLight.Define(stage, "/Cloth/Dome").CreateIntensityAttr(0.1)
    camera = UsdGeom.Camera.Define(stage, "/Cloth/Camera")
    camera.CreateProjectionAttr("orthographic")
    # In tenths of a unit.
    camera.CreateHorizontalApertureAttr(10.0)
    camera.CreateVerticalApertureAttr(10.0)
    UsdGeom.Xformable(camera).AddTranslateOp().Set(Gf.Vec3d(0.5, 0.5, 2.0))
    stage.GetRootLayer().Save()
    return path


def shown(scene: Scene) -> np.ndarray:
    made = render_scene(scene, width=SIZE, height=SIZE, spp=64, level="far")
    return made.layers["beauty"][..., :3]


def variant(look: Path, name: str) -> Scene:
    stage = Usd.Stage.Open(str(look))
    stage.GetDefaultPrim().GetVariantSets().SetSelection("fabricLook", name)
    stage.GetRootLayer().Export(str(look.with_name(f"{name}.usda")))
    return read_scene(look.with_name(f"{name}.usda"))


@pytest.mark.parametrize(
    "preset", ["linen_plain", pytest.param("silk_shot", marks=pytest.mark.exhaustive)]
)
def test_a_sheet_lets_as_much_of_an_even_sky_through_as_its_threads(preset):
    """Shiny threads send light on in narrow cones, of which a sheet has the mean."""
    fabric = conserving(preset)
    texels = mean_sample(fabric)
    found = fit("openpbr", texels, fabric)
    assert found.through_delta_e < 1.2 * found.through_start_delta_e
    wi, wo = direction_pairs()
    wi = wi * (1.0, 1.0, -1.0)
    i, o = (np.einsum("kab,nb->kna", frames_of(texels), w) for w in (wi, wo))
    got = albedo(
        found.look.transmission_scale * forward_through("openpbr", found.look, texels, i, o)[0]
    )
    true = albedo(surface.evaluate(fabric, wi, wo, level="far"))
    assert np.allclose(got.mean(axis=0), true.mean(axis=0), rtol=0.05)


@pytest.mark.exhaustive
def test_a_look_lit_from_behind_is_near_its_threads(tmp_path):
    fabric = conserving("linen_plain")
    cloth = write_screen(tmp_path / "cloth.usda", fabric)
    settings = BakeSettings(resolution=64, maps=(*MAPS, "transmission_color"))
    bake(cloth, tmp_path / "baked", settings, workers=1)
    write_materials(tmp_path / "baked", tmp_path / "look.usda", scene=cloth)
    look = variant(tmp_path / "look.usda", "baked")
    assert look.notes == []
    true, got = shown(read_scene(cloth)), shown(look)
    # The fit's views are not the picture's.
    assert abs(got.mean() / true.mean() - 1.0) < 0.06
    assert difference(got, true).delta_e_mean < 4.0
    dark = [
        replace(
            m, transmission=(0, 0, 0),
            textures={k: v for k, v in m.textures.items() if k != "transmission"},
        )
        for m in look.materials
    ]  # fmt: skip
    without = shown(replace(look, materials=dark))
    assert without.mean() < 0.6 * true.mean()


@pytest.mark.exhaustive
def test_a_fabric_without_a_bake_lets_as_much_light_through(tmp_path):
    fabric = conserving("linen_plain")
    looks = fitted_looks(fabric)
    stage = Usd.Stage.CreateNew(str(tmp_path / "m.usda"))
    write_fabric(stage, "/Fabric", fabric)
    binding = Binding(fabric=fabric, threads_per_uv=(1.0, 1.0))
    material = write_fabric_material(stage, "/Material", "/Fabric", binding, looks=looks)
    scale = material.GetInput("transmission_scale").Get()
    base = material.GetPrim().GetChild("through_scaled").GetAttribute("inputs:in1").Get()
    wi = hemisphere(4096) * (1.0, 1.0, -1.0)
    true = surface.evaluate(fabric, wi, (0.0, 0.0, 1.0)).mean(axis=0) * 2 * np.pi
    cover = UsdShade.Shader(material.GetPrim().GetChild("surface")).GetInput("geometry_opacity")
    got = np.array(scale) * np.array(base) * cover.Get()
    # Below the layers, which reflect some of it back.
    assert np.all(got > 0.95 * true)
    assert np.all(got < 1.35 * true)


def test_published_cloth_has_no_input_for_light_through(tmp_path):
    assert NEUTRAL["transmission_color"] == Value("color3", (0.0, 0.0, 0.0))
    fabric = load("linen_plain")
    stage = Usd.Stage.CreateNew(str(tmp_path / "m.usda"))
    write_fabric(stage, "/Fabric", fabric)
    binding = Binding(fabric=fabric, threads_per_uv=(1.0, 1.0))
    material = write_fabric_material(stage, "/Material", "/Fabric", binding)
    assert not material.GetInput("transmission_scale")
    assert not material.GetPrim().GetChild("through_scaled")


def test_a_surface_that_cannot_carry_the_light_is_named(tmp_path):
    cloth = write_screen(tmp_path / "cloth.usda", conserving("linen_plain"))
    settings = BakeSettings(resolution=64, maps=(*MAPS, "transmission_color"))
    bake(cloth, tmp_path / "baked", settings, workers=1)
    wanted = Settings(surfaces=("gltf_pbr", "standard_surface"), fitted=False)
    made = write_materials(tmp_path / "baked", tmp_path / "look.usda", wanted, scene=cloth)
    told = [n for n in made.notes if "light that comes through" in n]
    assert len(told) == 1
    assert "gltf_pbr" in told[0]
    assert "openpbr or standard_surface" in told[0]


def test_a_transmission_that_cannot_be_read_is_a_note(tmp_path):
    fabric = conserving("linen_plain")
    stage = Usd.Stage.Open(str(write_screen(tmp_path / "cloth.usda", fabric)))
    binding = Binding(fabric=fabric, threads_per_uv=(24.0, 24.0))
    material = write_fabric_material(stage, "/Cloth/M", "/Cloth/Fabric", binding)
    material.GetPrim().RemoveAPI("WovenBindingAPI")
    material.GetPrim().RemoveProperty("fabric:binding")
    mesh = stage.GetPrimAtPath("/Cloth/Mesh")
    mesh.RemoveProperty("fabric:binding")
    UsdShade.MaterialBindingAPI.Apply(mesh).Bind(material)
    where = str(tmp_path / "made.usda")
    stage.GetRootLayer().Export(where)
    found = read_scene(where)
    assert any(m.transmission != (0, 0, 0) for m in found.materials)
    material.GetPrim().RemoveProperty("inputs:transmission_scale")
    prim = material.GetPrim()
    prim.CreateAttribute("inputs:transmission_scale", Sdf.ValueTypeNames.String).Set("much")
    stage.GetRootLayer().Export(where)
    told = read_scene(where)
    assert any("transmission_scale much" in note for note in told.notes)
    assert mean_values(fabric, _lay(binding))["transmission_color"].value != (0.0, 0.0, 0.0)


def _lay(binding: Binding):
    from fabricusd.bake.layout.garment import lay_of

    return lay_of(binding, metres_per_uv=1.0)

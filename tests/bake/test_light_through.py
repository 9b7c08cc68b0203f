"""Bakes of cloth that light comes through: both sides, what is transmitted, and its error."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance import surface
from fabricusd.bake.bake import bake, plan
from fabricusd.bake.error.accuracy import pairs_between, swatch_error
from fabricusd.bake.error.relight import BakedSet
from fabricusd.bake.job import Settings
from fabricusd.bake.layout.garment import garments
from fabricusd.bake.texels import moment_indices as m
from fabricusd.bake.texels.blocks import bake_block
from fabricusd.bake.texels.maps import chosen_maps
from fabricusd.bake.texels.recipe import recipe
from fabricusd.bake.texels.sheet import sheets_of
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric, even
from fabricusd.schema import load, save_all
from tests.appearance.presets import LINEN, often
from tests.bake.meshes import quad_scene, write_quad

THROUGH = ("transmission_color", "back_base_color")
SKY = 4096


def conserving(preset: str = "linen_plain") -> Fabric:
    return replace(even(load(preset)), model="conserving")


def share(fabric: Fabric, below: bool) -> np.ndarray:
    """(3,) share of the light of one side that level `far` scatters to a viewer at the normal."""
    k = np.arange(SKY) + 0.5
    z, phi = k / SKY, k * np.pi * (3.0 - np.sqrt(5.0))
    flat = np.sqrt(1.0 - z * z)
    wi = np.stack((flat * np.cos(phi), flat * np.sin(phi), -z if below else z), axis=1)
    return surface.evaluate(fabric, wi, (0.0, 0.0, 1.0)).mean(axis=0) * 2.0 * np.pi


@pytest.mark.parametrize(
    "preset", often(["linen_plain", "silk_shot", "polyester_satin_charmeuse"], LINEN)
)
def test_the_mean_texel_has_the_reflectance_and_transmittance_of_the_cloth(preset):
    fabric = conserving(preset)
    mean = recipe(fabric).mean
    reflected = mean[m.SURFACE] + mean[m.VOLUME : m.VOLUME + 3]
    assert np.allclose(reflected, share(fabric, below=False), rtol=0.02, atol=5e-4)
    assert np.allclose(mean[m.THROUGH : m.THROUGH + 3], share(fabric, below=True), rtol=0.02)


@pytest.mark.exhaustive
def test_the_back_of_the_mean_texel_is_the_front_of_the_fabric_on_the_back():
    fabric = conserving("polyester_satin_charmeuse")
    behind = replace(fabric.back, model="conserving")
    mean = recipe(replace(fabric, back=behind)).mean
    front = recipe(behind, back=False).mean
    assert np.allclose(mean[m.BACK_COVER], front[m.COVER], atol=2e-3)
    assert np.allclose(mean[m.BACK_VOLUME :], front[m.VOLUME : m.VOLUME + 3], rtol=0.02)


def test_opaque_and_published_cloth_transmits_nothing():
    for fabric in (load("linen_plain"), conserving("velvet")):
        assert not recipe(fabric).mean[m.THROUGH : m.THROUGH + 3].any()


def test_maps_of_light_through_are_baked_where_light_comes_through():
    names = {t.name for t in chosen_maps(None, light=False)}
    assert names.isdisjoint(THROUGH)
    more = {t.name for t in chosen_maps(None, light=False, through=True)}
    assert more == names | set(THROUGH)


@pytest.mark.parametrize(
    "preset",
    [pytest.param("linen_plain", marks=pytest.mark.exhaustive), "silk_shot"],
)
def test_texels_relight_conserving_cloth_from_both_sides(preset):
    fabric = conserving(preset)
    one = garments(quad_scene(fabric, 8.0))[0]
    sheet = sheets_of(one, (recipe(fabric, back=False),), {1001: (0, 0)}, 128, 4)[0]
    error = swatch_error(sheet)
    assert error.texel < 1.5
    assert error.behind is not None
    assert error.behind < 1.5
    held_back = swatch_error(sheet, pairs=pairs_between(20, skip=32))
    assert held_back.worst_pair <= error.bound


def test_the_coarsest_texel_is_level_far_lit_from_behind(tmp_path):
    fabric = conserving()
    bake(write_quad(tmp_path / "quad.obj"), tmp_path / "b", Settings(resolution=64), fabric=fabric)
    wi, wo = pairs_between(8)
    baked = BakedSet.load(tmp_path / "b")
    for side in (1.0, -1.0):
        for i, o in zip(wi * (1, 1, side), wo, strict=True):
            got = baked.relight("quad_obj", [fabric], i, o, level=6)[0, 0]
            true = surface.evaluate(fabric, i, o)[0]
            assert np.allclose(got, true, rtol=0.08, atol=2e-3), (side, i, o)


@pytest.mark.exhaustive
def test_a_bake_of_conserving_cloth_is_whole_and_can_be_resumed(tmp_path):
    fabric = conserving("silk_shot")
    source = write_quad(tmp_path / "quad.obj")
    settings = Settings(resolution=64)
    bake(source, tmp_path / "once", settings, fabric=fabric)

    class Killed(Exception):
        pass

    def kill(_noun, total, done):
        if done >= 1:
            raise Killed

    with pytest.raises(Killed):
        bake(source, tmp_path / "twice", settings, fabric=fabric, progress=kill)
    bake(source, tmp_path / "twice", settings, fabric=fabric, resume=True)
    files = sorted(p.name for p in (tmp_path / "once").glob("*.exr"))
    assert {f"quad_obj.{name}.exr" for name in THROUGH} <= set(files)
    for name in files:
        first, second = ((tmp_path / f / name).read_bytes() for f in ("once", "twice"))
        assert first == second, name
    said = json.loads((tmp_path / "once" / "manifest.json").read_text())
    assert said["garments"]["quad_obj"]["error"]["behind"] < 5
    assert "transmission_color" in said["garments"]["quad_obj"]["map_error"]
    report = (tmp_path / "once" / "report.html").read_text()
    assert "lit from behind" in report


def test_the_back_of_each_texel_is_that_of_its_own_weave():
    """A satin repeats after 5 threads, its back after 3: together after 15."""
    fabric = conserving("polyester_satin_charmeuse")
    fabric = replace(fabric, back=replace(fabric.back, model="conserving"))
    one = garments(quad_scene(fabric, 1024.0, rotation=0.3))[0]
    looked_up = sheets_of(one, (recipe(fabric),), {1001: (0, 0)}, 1024, 4)[0]
    assert looked_up.tables[0] is not None
    computed = replace(looked_up, tables=(None,))
    maps = chosen_maps(("back_base_color",), light=False)
    a, c = (bake_block(sheet, maps, 0, 0)[0][0][0] for sheet in (looked_up, computed))
    # Looked up in the front's repeat, they would differ by 0.9 of their own deviation.
    scale = float(np.std(np.float64(c)))
    assert scale > 1e-3
    assert np.sqrt(np.mean((np.float64(a) - c) ** 2)) < 0.3 * scale


def test_a_map_of_the_back_needs_cloth_that_light_comes_through(tmp_path):
    source = write_quad(tmp_path / "quad.obj")
    settings = Settings(resolution=64, maps=("back_base_color",))
    with pytest.raises(FabricError, match="needs a fabric that light comes through"):
        plan(source, settings, fabric="linen_plain")


def test_a_back_that_is_changed_changes_the_garment():
    fabric = conserving("polyester_satin_charmeuse")
    other = replace(fabric, back=None)
    found = [garments(quad_scene(f))[0].fingerprint for f in (fabric, other)]
    assert found[0] != found[1]


def test_a_dry_run_describes_a_bake_of_conserving_cloth(tmp_path):
    save_all([conserving()], tmp_path / "cloth.usda")
    planned = plan(
        write_quad(tmp_path / "quad.obj"), Settings(resolution=64),
        fabric=f"{tmp_path / 'cloth.usda'}:/linen_plain",
    )  # fmt: skip
    assert len(chosen_maps(None, light=False, through=True)) == int(
        planned.lines[0].split(": ")[1].split()[0]
    )

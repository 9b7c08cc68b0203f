"""Textures with each thread's fit in them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdShade

from fabricusd.appearance.weave.lookup import NO_THREAD
from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings as BakeSettings
from fabricusd.bake.texels.maps import NO_LAY
from fabricusd.images.files import read_mip_level
from fabricusd.materials.bake_folder import read_bake_folder
from fabricusd.materials.fit.texels import NEEDED
from fabricusd.materials.fit.thread_maps import write_thread_maps
from fabricusd.materials.materials import write_materials
from tests.materials.scenes import write_shirt


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    """Linen and velvet at more than two texels a thread, with the threads' numbers."""
    folder = tmp_path_factory.mktemp("threads")
    scene = write_shirt(folder / "shirt.usda")
    bake(scene, folder / "baked", BakeSettings(resolution=128, maps=(*NEEDED, "thread_id", "lay")))
    return folder / "baked"


def factors(base):
    """(8,) a factor on the base colour, 0.5 on both roughnesses, a red tint."""
    return np.array([base, base, base, 0.5, 0.5, 1.0, 0.2, 0.1])


def test_a_texel_takes_its_threads_factors_and_other_lays_stay(baked, tmp_path):
    maps = read_bake_folder(baked).garments[0]
    one = {0: factors(0.5), 1: factors(0.25), -1: factors(0.4)}
    made = write_thread_maps(maps, {0: one}, tmp_path)
    ids = read_mip_level(maps.textures["thread_id"][1001])[..., 0]
    lay = read_mip_level(maps.textures["lay"][1001])[..., 0]
    before = read_mip_level(maps.textures["base_color"][1001])
    after = read_mip_level(made.textures["base_color"][1001])
    for number, factor in ((0, 0.5), (1, 0.25), (NO_THREAD, 0.4)):
        mine = (lay == 0) & (ids == number)
        assert mine.any()
        assert np.allclose(after[mine], factor * before[mine], rtol=2e-3)
    assert np.array_equal(after[lay == 1], before[lay == 1])
    tint = read_mip_level(made.textures["specular_tint"][1001])
    assert np.allclose(tint[lay == 0], (1.0, 0.2, 0.1), atol=1e-3)
    assert (tint[lay != 0] == 1.0).all()
    assert made.textures["normal"] == maps.textures["normal"]


def test_levels_are_means_of_colours_and_the_bakes_own_roughness(baked, tmp_path):
    maps = read_bake_folder(baked).garments[0]
    same = {k: factors(0.5) for k in (0, 1, 2, 3, -1)}
    made = write_thread_maps(maps, {0: same, 1: same}, tmp_path)
    colors = made.textures["base_color"][1001]
    fine = read_mip_level(colors).reshape(64, 2, 64, 2, 3).mean(axis=(1, 3))
    assert np.allclose(read_mip_level(colors, 1), fine, atol=1e-3)
    inside = read_mip_level(maps.textures["lay"][1001], 3)[..., 0] != NO_LAY
    rough = read_mip_level(made.textures["roughness_across"][1001], 3)[inside]
    own = read_mip_level(maps.textures["roughness_across"][1001], 3)[inside]
    within = np.isclose(rough, 0.5 * own, rtol=2e-3)
    assert within[..., 0].mean() > 0.6
    assert read_mip_level(colors, 7).shape == (1, 1, 3)


def test_a_look_of_resolved_threads_reads_the_fitted_maps(baked, tmp_path, monkeypatch):
    for constant, few in (("FIRST", 2), ("MORE", 2), ("ROUNDS", 1)):
        monkeypatch.setattr(f"fabricusd.materials.fit.fit.{constant}", few)
    monkeypatch.setattr("fabricusd.materials.fit.judge.VIEWS", 4)
    monkeypatch.setattr("fabricusd.materials.fit.judge.LIGHTS", 24)
    write_materials(baked, tmp_path / "look.usda")
    said = json.loads((tmp_path / "look.json").read_text())
    assert [sorted(one) for one in said["threads"].values()] == [["0", "1"], ["0", "3"]]
    stage = Usd.Stage.Open(str(tmp_path / "look.usda"))
    found = {}
    for prim in stage.Traverse():
        file = UsdShade.Shader(prim).GetInput("file") if prim.IsA(UsdShade.Shader) else None
        if file and isinstance(file.Get(), Sdf.AssetPath):
            found.setdefault(prim.GetName(), set()).add(file.Get().path)
    for name in ("base_color", "roughness_along", "roughness_across"):
        assert found[name] == {f"./look_maps/Body.{name}.exr"}
    assert found["specular_tint_map"] == {"./look_maps/Body.specular_tint.exr"}
    assert "look_maps" not in next(iter(found["Preview_base_color"]))

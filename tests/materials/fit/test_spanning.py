"""Maps of reflections where texels do not resolve threads."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings as BakeSettings
from fabricusd.fabric import Binding
from fabricusd.images.files import read_mip_level
from fabricusd.materials.bake_folder import read_bake_folder
from fabricusd.materials.fit.spanning import (
    CHANNELS,
    lobe_level,
    takes_the_mean,
    write_spanning_maps,
)
from fabricusd.materials.fit.texels import draw_texels, mean_texel
from fabricusd.materials.materials import write_materials
from fabricusd.materials.recipes import Settings
from fabricusd.schema import load, write_binding, write_fabric
from tests.reference.stages import new_stage, square


@pytest.mark.parametrize(
    ("threads", "width", "level"),
    [(64, 512, 0), (128, 512, 0), (129, 512, 4), (480, 512, 3), (1100, 512, 1), (4096, 512, 0)],
)
def test_lobes_are_of_single_threads_or_of_four_and_more(threads, width, level):
    found = lobe_level(np.diag((threads, 2.0 * threads)), width)
    assert found == level
    assert found == 0 or threads / width * 2**found >= 4.0


@pytest.fixture(scope="module", params=[False, True], ids=["one tile", "tiles"])
def baked(request, tmp_path_factory):
    """Linen at 1.07 texels per thread, in one picture or in UDIM tiles."""
    folder = tmp_path_factory.mktemp("spanning")
    stage = new_stage(folder)
    mesh = square(stage)
    write_fabric(stage, "/Looks/Cloth", load("linen_plain"))
    binding = Binding(fabric=load("linen_plain"), threads_per_uv=(60.0, 60.0))
    write_binding(mesh.GetPrim(), "/Looks/Cloth", binding)
    stage.GetRootLayer().Save()
    settings = BakeSettings(resolution=64, udim=request.param)
    bake(folder / "scene.usda", folder / "b", settings, workers=1)
    return read_bake_folder(folder / "b").garments[0]


def test_the_maps_are_the_mean_of_the_cloth(baked, tmp_path):
    assert takes_the_mean(baked, baked.lays[0])
    made, files = write_spanning_maps(baked, 0, tmp_path)
    assert sorted(files) == sorted(made.textures[name][1001] for name in CHANNELS)
    for name in baked.textures:
        if name not in CHANNELS:
            assert made.textures[name] == baked.textures[name]
    found = {name: read_mip_level(made.textures[name][1001])[0, 0] for name in CHANNELS}
    assert found["roughness_along"] <= found["roughness_across"]
    assert found["normal"] == pytest.approx((0, 0, 1), abs=0.02)
    assert np.linalg.norm(found["tangent"]) == pytest.approx(1, abs=1e-3)
    # Linen is alike in both directions, so that its mean is nearly round; its threads are not.
    fine = {name: read_mip_level(baked.textures[name][1001]) for name in CHANNELS}
    ratio = float(found["roughness_along"][0] / found["roughness_across"][0])
    assert ratio > np.median(fine["roughness_along"] / fine["roughness_across"])
    whole = read_mip_level(baked.textures["roughness_across"][1001], 6)[0, 0]
    assert found["roughness_across"] == pytest.approx(whole, rel=0.03)


@pytest.mark.parametrize(("times", "mean"), [(1 / 8, False), (2 / 3, True), (4, True), (16, True)])
def test_all_texels_that_do_not_resolve_threads_take_the_mean(baked, times, mean):
    lay = replace(baked.lays[0], matrix=baked.lays[0].matrix * times)
    assert takes_the_mean(baked, lay) == mean


def test_a_lay_in_two_directions_of_texels_keeps_its_axes(tmp_path, monkeypatch):
    """The mean of tensors: half of the texels point along the warp, half along the weft."""
    from fabricusd.materials.fit import spanning

    side = np.zeros((4, 4, 3))
    side[:2, :, 0], side[2:, :, 1] = 1.0, 1.0
    given = {
        "tangent": side, "normal": np.broadcast_to((0.0, 0, 1), (4, 4, 3)),
        "roughness_along": np.where(side[..., :1] > 0, 0.4, 0.5),
        "roughness_across": np.where(side[..., :1] > 0, 0.8, 0.7),
    }  # fmt: skip
    maps = SimpleNamespace(
        textures={name: {1001: name} for name in CHANNELS},
        lays=[SimpleNamespace(matrix=np.eye(2) * 8)],
    )
    monkeypatch.setattr(spanning, "level_pixels", lambda file, level: given[file])
    monkeypatch.setattr(spanning, "_width", lambda maps: 4)
    found = spanning._mean(maps, 0)
    x = 0.5 * (0.4**4 + 0.7**4)
    y = 0.5 * (0.8**4 + 0.5**4)
    assert np.abs(found["tangent"]) == pytest.approx((1, 0, 0), abs=1e-6)
    assert found["roughness_along"][0] == pytest.approx(x**0.25)
    assert found["roughness_across"][0] == pytest.approx(y**0.25)


def test_fits_see_the_maps_that_the_look_has(baked, tmp_path):
    made, _ = write_spanning_maps(baked, 0, tmp_path)
    fine, mean = (draw_texels(one, 0, one.lays[0]) for one in (baked, made))
    assert fine is not None
    assert mean is not None
    # Across one texel there are warp and weft, so that no texel of the means is as smooth.
    assert mean.smooth.min() > fine.smooth.min() + 0.05
    assert np.ptp(mean.smooth) < 1e-6
    assert np.average(mean.base, axis=0, weights=mean.weight) == pytest.approx(
        np.average(fine.base, axis=0, weights=fine.weight), rel=0.02
    )
    assert mean_texel(made, 0)["base_color"] == mean_texel(baked, 0)["base_color"]


def test_a_look_names_the_maps_that_span_threads(baked, tmp_path):
    write_materials(baked.folder, tmp_path / "look.usda", Settings(fitted=False))
    said = (tmp_path / "look.usda").read_text()
    number = ".<UDIM>" if baked.udim else ""
    for name in ("roughness_along", "roughness_across", "tangent"):
        assert f"look_maps/{baked.name}.{name}.lay0{number}.exr@" in said
    assert f"look_maps/{baked.name}.normal.lay0." in said
    assert f"{baked.name}.base_color" in said
    assert "base_color.lay0" not in said

"""The maps of a bake in glTF's terms."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings as BakeSettings
from fabricusd.fabric import Binding
from fabricusd.materials.bake_folder import read_bake_folder
from fabricusd.materials.fit.spanning import lobe_level
from fabricusd.materials.networks.look import Look
from fabricusd.materials.recipes import Written, texture_inputs
from fabricusd.materials.targets.gltf.layers import (
    alpha_mode,
    alphas,
    beside_through,
    layers_of,
    rougher,
    strength,
)
from fabricusd.schema import load, write_binding, write_fabric
from tests.reference.stages import new_stage, square

RNG = np.random.default_rng(3)


def test_the_extension_turns_roughness_and_strength_back_into_both_alphas():
    along, across = RNG.uniform(0.05, 1.2, (2, 40, 40, 1))
    look = Look(smooth_scale=0.9, rough_scale=1.1)
    smooth, rough = alphas(along, across, look)
    assert np.allclose(smooth, np.minimum((0.9 * along) ** 2, 1.0))
    s = strength(smooth, rough)
    roughness = np.sqrt(smooth)
    # mix(x, y, m) = x (1 - m) + y m, of the extension's text
    assert np.allclose(roughness**2 * (1.0 - s**2) + s**2, rough)
    assert (rough >= smooth).all()


def test_the_rougher_direction_is_a_quarter_turn_from_the_tangent():
    angle = RNG.uniform(0, 2 * np.pi, (5, 5))
    tangent = np.stack((np.cos(angle), np.sin(angle), 0.3 + 0 * angle), axis=-1)
    found = rougher(tangent)
    assert np.allclose((found * tangent[..., :2]).sum(axis=-1), 0.0)
    assert np.allclose(np.linalg.norm(found, axis=-1), 1.0)
    assert np.allclose(rougher(np.array([[[1.0, 0.0, 0.0]]])), (0.0, 1.0))
    assert np.array_equal(rougher(np.zeros((1, 1, 3)))[0, 0], (1.0, 0.0))


@pytest.mark.parametrize(
    ("cover", "opaque", "mode"),
    [
        (np.ones(100), True, "OPAQUE"),
        (np.repeat([0.0, 1.0], [30, 70]), False, "MASK"),
        (np.full(100, 0.7), False, "BLEND"),
        (np.full(100, 0.99), False, "MASK"),
        (np.full(100, 0.97), False, "BLEND"),
    ],
)
def test_gaps_are_cut_out_where_that_keeps_the_mean_cover(cover, opaque, mode):
    assert alpha_mode(cover, opaque=opaque) == mode


def test_the_sheet_that_lets_light_through_reflects_what_it_did():
    base, through = RNG.uniform(0.1, 0.4, (2, 6, 6, 3))
    made, weight, color = beside_through(base, through)
    assert np.allclose((1.0 - weight) * made, base)
    assert np.allclose(weight * color, through)
    assert np.allclose(color.max(axis=-1), 1.0)


def test_near_a_texel_a_thread_the_lobes_are_means_and_colours_stay_fine(tmp_path):
    """A GPU's mean of a warp's direction and a weft's is the diagonal, along which nothing lies."""
    stage = new_stage(tmp_path)
    mesh = square(stage)
    fabric = load("linen_plain")
    write_fabric(stage, "/Looks/Cloth", fabric)
    binding = Binding(fabric=fabric, threads_per_uv=(60.0, 60.0))
    write_binding(mesh.GetPrim(), "/Looks/Cloth", binding)
    stage.GetRootLayer().Save()
    bake(tmp_path / "scene.usda", tmp_path / "b", BakeSettings(resolution=64), workers=1)
    maps = read_bake_folder(tmp_path / "b").garments[0]
    made = Written()
    inputs = texture_inputs(maps, tmp_path / "look.usda", made)
    level = lobe_level(maps.lays[0].matrix, 64)
    assert level == 3
    fine = layers_of(inputs, Look(), 1001)
    mean = layers_of(inputs, Look(), 1001, normals=maps.textures["normal"][1001], level=level)
    assert mean.base.shape == fine.base.shape == (64, 64, 3)
    for name in ("roughness", "strength", "direction", "normal"):
        assert getattr(mean, name).shape[:2] == (8, 8), name
    assert np.std(mean.roughness) < 0.25 * np.std(fine.roughness)

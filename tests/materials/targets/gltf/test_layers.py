"""The maps of a bake in glTF's terms."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.materials.networks.look import Look
from fabricusd.materials.targets.gltf.layers import (
    alpha_mode,
    alphas,
    beside_through,
    rougher,
    strength,
)

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

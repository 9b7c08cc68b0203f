"""The report's maps: each in its own range, and nothing outside the layout counts."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.bake.layout.garment import garments
from fabricusd.bake.report_maps import GROUND, fullest, shown
from fabricusd.bake.texels.maps import REGISTRY
from fabricusd.fabric import Fabric
from fabricusd.images.files import read_part, write_png
from tests.bake.meshes import quad_scene


def ramp(low: float, high: float) -> np.ndarray:
    return np.linspace(low, high, 16, dtype=np.float32).reshape(4, 4, 1)


def test_a_map_is_scaled_to_its_own_range_and_the_legend_says_which():
    found = shown(ramp(-0.02, 0.31), REGISTRY["height"])
    assert (found.low, found.high) == (pytest.approx(-0.02), pytest.approx(0.31))
    assert found.legend == "-0.02 to 0.31 mm"
    assert found.picture.min() == 0
    assert found.picture.max() == 255


def test_what_lies_outside_the_layout_is_ground_and_does_not_widen_the_range():
    values, covered = ramp(0.4, 0.6), np.ones((4, 4), bool)
    values[0, 0], covered[0, 0] = 9.0, False
    found = shown(values, REGISTRY["opacity"], covered)
    assert found.high == pytest.approx(0.6)
    assert tuple(found.picture[0, 0]) == (GROUND,) * 3
    assert shown(values, REGISTRY["opacity"]).high == pytest.approx(9.0)
    nothing = shown(values, REGISTRY["opacity"], np.zeros((4, 4), bool))
    assert (nothing.picture == GROUND).all()


def test_of_a_map_of_four_numbers_three_are_shown_and_the_legend_says_so():
    values = np.concatenate([ramp(0, 1)] * 3 + [ramp(7, 9)], axis=2)
    found = shown(values, REGISTRY["horizon_00"])
    assert found.picture.shape == (4, 4, 3)
    assert "0 (dark) to 1 (bright)" in found.legend
    assert "fourth number is not shown" in found.legend


def test_an_even_map_says_its_value():
    assert "0.5 everywhere" in shown(np.full((4, 4, 1), 0.5), REGISTRY["opacity"]).legend


def test_colors_are_shown_as_they_are_and_directions_about_grey():
    white = shown(np.ones((2, 2, 3)), REGISTRY["base_color"])
    assert (white.picture == 255).all()
    assert "#ffffff" in white.legend
    up = shown(np.tile(np.float32([0, 0, 1]), (2, 2, 1)), REGISTRY["normal"])
    assert tuple(up.picture[0, 0]) == (128, 128, 255)


@pytest.mark.parametrize("corner", [(0.0, 0.0), (0.7, 0.2), (0.6, 0.7)])
def test_the_part_that_is_shown_holds_the_layout(corner):
    u, v = corner
    uv = [[u, v], [u + 0.25, v], [u + 0.25, v + 0.25], [u, v + 0.25]]
    one = garments(quad_scene(Fabric(), uv=uv))[0]
    at = fullest(one, 1001, 0.25)
    assert np.abs(np.array(at) - (u + 0.125, v + 0.125)).max() < 0.13


def test_a_part_is_read_from_where_it_is_asked(tmp_path):
    pixels = np.zeros((256, 256, 1), np.uint8)
    pixels[:64, 192:] = 255  # the upper right
    write_png(tmp_path / "a.png", pixels)
    assert read_part(tmp_path / "a.png", 64, (0.9, 0.9)).min() == 1
    assert read_part(tmp_path / "a.png", 64, (0.9, 0.1)).max() == 0
    assert read_part(tmp_path / "a.png", 64).max() == 0

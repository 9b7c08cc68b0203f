"""Parts of a cloth and the texels that show them."""

from __future__ import annotations

import numpy as np
import pytest
from materials.near.cloths import PARTS

from fabricusd.appearance.weave.coverage import coverage
from fabricusd.bake.texels.angle_rows import steepness
from fabricusd.materials.near.parts import COUNT, mean_of, parts_of
from fabricusd.materials.near.points import points_of
from fabricusd.schema import load


@pytest.mark.parametrize("preset", ["linen_plain", "polyester_satin_charmeuse"])
def test_the_parts_cover_what_the_threads_cover(preset):
    fabric = load(preset)
    assert parts_of(fabric).share.sum() == pytest.approx(coverage(fabric).type_area.sum())


def test_the_first_part_of_each_set_falls_gently_and_the_last_rises_steeply():
    fabric = load("linen_plain")
    angle, split = parts_of(fabric).angle, steepness(fabric)
    for which in (0, 1):
        gentle, steep, rising, steeper = angle[4 * which : 4 * which + 4]
        assert 0 < gentle < split[which] < steep
        assert steeper < -split[which] < rising < 0


def test_points_stand_for_their_parts():
    fabric = load("silk_shot")
    points, parts = points_of(fabric), parts_of(fabric)
    share = np.bincount(points.part, points.weight, COUNT)
    assert share == pytest.approx(parts.share)
    angle = np.bincount(points.part, points.weight * points.angle, COUNT) / np.maximum(share, 1e-9)
    assert angle == pytest.approx(parts.angle, abs=0.02)


def test_the_mean_of_points_is_the_texel_that_shows_them_all():
    rng = np.random.default_rng(0)
    part = rng.choice(COUNT, 4000, p=PARTS.share / PARTS.share.sum())
    texels = PARTS.at(part // 4, PARTS.angle[part], part)
    mean = mean_of(texels)
    assert mean.share[0] == pytest.approx(np.bincount(part, minlength=COUNT) / 4000)
    assert mean.lean == pytest.approx(0.0)
    assert mean.tint[0].sum(axis=0) == pytest.approx(1.0)

"""The lobes of a texel: from afar the far mixture, near by those of its threads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from materials.lobes.mixtures import LEVEL, PAIR, directions, mixture
from materials.near.cloths import PARTS, mixed, near_mixture, point

from fabricusd.materials.lobes import mixture as far
from fabricusd.materials.lobes.mixture import FORMS
from fabricusd.materials.near.mixture import EPSILON, constants, evaluate, placed


@pytest.mark.parametrize("form", FORMS)
def test_the_texel_that_shows_the_whole_cloth_is_the_far_mixture(form):
    one = near_mixture(mixture(form, PAIR, LEVEL))
    wi, wo = directions(400)
    truth = far.evaluate(one.far, wi, wo)
    assert np.abs(evaluate(one, PARTS.texel, wi, wo) - truth).max() <= 1e-12 * truth.max()


def test_a_texel_in_between_is_not_the_far_mixture():
    one = near_mixture()
    wi, wo = directions(400)
    truth = far.evaluate(one.far, wi, wo)
    assert np.abs(evaluate(one, mixed(), wi, wo) - truth).max() > 0.1 * truth.max()


def test_a_gap_reflects_nothing():
    one = near_mixture()
    nothing = mixed(gap=1.0)
    assert np.all(evaluate(one, nothing, *directions(50)) == 0.0)


def test_at_a_point_of_a_thread_its_lobes_are_at_its_angle_and_narrow():
    """What is left of the far lobe is as much as EPSILON is of the variance of the angles."""
    one = near_mixture()
    for number in (0, 1):
        found = placed(one, number, point(1))
        known = constants(one, number)
        left = np.sqrt(EPSILON / (known.variance + EPSILON))
        tilt = one.lobes[number][1]
        angle = PARTS.angle[1] + 0.03
        assert found.tilt[0] - angle == pytest.approx((tilt - known.mean) * left)
        wide, narrow = PAIR.alpha_along**2, one.own[number] ** 2
        assert found.alpha[0] ** 2 == pytest.approx(narrow + (wide - narrow) * left**2)
        assert found.alpha[0] < 0.8 * PAIR.alpha_along


def test_threads_across_the_axis_of_a_lobe_do_not_turn_it():
    one = near_mixture()
    found = placed(one, 0, point(4))
    assert found.tilt[0] == one.lobes[0][1]
    assert found.alpha[0] == pytest.approx(PAIR.alpha_along)


def test_the_color_of_a_lobe_is_that_of_the_parts_and_of_their_tint():
    one, texel = near_mixture(), mixed()
    tint = texel.tint[0] / texel.sets[0, :, None]
    tint = 1.0 + one.tinted[:, None] * (tint - 1.0)
    truth = sum(
        texel.share[0, b] * one.factors[2, b] * tint[b // 4] for b in range(len(PARTS.share))
    )
    assert placed(one, 2, texel).color[0] == pytest.approx(truth * LEVEL.color)


def test_without_factors_of_mean_1_the_far_mixture_would_be_lost():
    one = near_mixture()
    wrong = replace(one, factors=1.2 * one.factors)
    wi, wo = directions(50)
    ratio = evaluate(wrong, PARTS.texel, wi, wo).sum() / far.evaluate(one.far, wi, wo).sum()
    assert ratio == pytest.approx(1.2)

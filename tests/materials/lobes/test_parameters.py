"""Numbers of a mixture, and derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from materials.lobes.mixtures import GAUSSIAN, LEVEL, PAIR, directions, mixture

from fabricusd.materials.lobes.mixture import CYCLES, FORMS, MATERIALX, evaluate
from fabricusd.materials.lobes.parameters import (
    at_bounds,
    bounds,
    pack,
    unpack,
    value_and_slopes,
)


@pytest.mark.parametrize("form", FORMS)
def test_unpacking_what_was_packed_changes_nothing(form):
    one = mixture(form)
    back = unpack(pack(one), one)
    assert pack(back) == pytest.approx(pack(one))
    assert [x.along for x in back.lobes] == [x.along for x in one.lobes]


@pytest.mark.parametrize("form", FORMS)
def test_the_value_is_that_of_the_mixture(form):
    wi, wo = directions(300)
    got, _ = value_and_slopes(mixture(form), wi, wo, slopes=False)
    assert got == pytest.approx(evaluate(mixture(form), wi, wo))


@pytest.mark.parametrize(("form", "pair"), [(CYCLES, PAIR), (CYCLES, GAUSSIAN), (MATERIALX, PAIR)])
def test_the_derivatives_are_those_of_differences(form, pair):
    # A lobe off the upright, so that its tilt may move.
    one = mixture(form, pair, replace(LEVEL, tilt=0.2))
    wi, wo = directions(200)
    _, slopes = value_and_slopes(one, wi, wo)
    x, step = pack(one), 1e-4
    for k in range(len(x)):
        ahead, behind = x.copy(), x.copy()
        ahead[k] += step
        behind[k] -= step
        two = [value_and_slopes(unpack(y, one), wi, wo, slopes=False)[0] for y in (ahead, behind)]
        wanted = (two[0] - two[1]) / (2 * step)
        # Where a direction crosses the edge of a lobe there is no derivative.
        off = np.abs(slopes[k] - wanted).max(axis=1) > 1e-3 * max(np.abs(wanted).max(), 1e-3)
        assert off.mean() <= 0.01, k


def test_a_level_lobe_stays_level():
    one = mixture(FORMS[0], LEVEL)
    moved = pack(one)
    moved[0] = 0.3
    assert unpack(moved, one).lobes[0].tilt == 0.0


def test_a_number_at_its_bound_is_named():
    low, high = bounds(mixture(FORMS[0]))
    x = pack(mixture(FORMS[0]))
    assert at_bounds(mixture(FORMS[0])) == []
    x[2] = high[2]
    x[10] = low[10]
    told = at_bounds(unpack(x, mixture(FORMS[0])))
    assert told == [
        "alpha_across of lobe 0 is at its greatest", "alpha_along of lobe 1 is at its least"
    ]  # fmt: skip


def test_a_part_that_is_not_there_is_not_at_a_bound():
    one = replace(mixture(FORMS[0]), sheen=(0.0, 0.0, 0.0))
    assert at_bounds(one) == []

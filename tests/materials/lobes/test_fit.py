"""Fits: of mixtures that are known, and of fabrics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from materials.lobes.mixtures import GAUSSIAN, LEVEL, PAIR, mixture

from fabricusd.errors import FabricError
from fabricusd.materials.lobes.fit import COUNTS, Problem, _found, fit
from fabricusd.materials.lobes.judge import Judge
from fabricusd.materials.lobes.mixture import CYCLES, FORMS, evaluate
from fabricusd.materials.lobes.parameters import pack, unpack
from fabricusd.materials.lobes.starts import flank, grown, starts, turned
from fabricusd.materials.lobes.target import GRAZING, VIEWS, Pairs, fitted_directions
from fabricusd.schema import load

PRESETS = ("linen_plain", "silk_shot", "polyester_satin_charmeuse", "velvet")


def problem_of(one):
    wi, wo = fitted_directions()
    views = VIEWS + len(GRAZING)
    return Problem(Pairs(wi=wi, wo=wo, values=evaluate(one, wi, wo), views=views))


@pytest.mark.parametrize("form", FORMS)
def test_a_mixture_is_found_again_from_beside_it(form):
    dim = (replace(PAIR, color=(0.05, 0.1, 0.03)), replace(LEVEL, color=(0.2, 0.05, 0.1)))
    wanted = mixture(form, *dim)
    problem = problem_of(wanted)
    x = pack(wanted)
    moved = x + 0.15 * np.where(np.arange(len(x)) % 2, 1.0, -1.0) * (np.abs(x) > 0)
    begun = unpack(moved, wanted)
    found = problem.solve(begun, 12, evened=False)
    assert problem.delta_e(begun) > 3.0
    assert problem.delta_e(found) < 0.2


def test_a_mixture_that_is_right_has_no_error():
    problem = problem_of(mixture(CYCLES))
    assert problem.score(mixture(CYCLES)) == pytest.approx(0.0, abs=1e-9)


def test_light_too_much_costs_more_than_light_too_little():
    problem = problem_of(mixture(CYCLES))
    bright, dark = (
        replace(mixture(CYCLES), diffuse=tuple(d + off for d in (0.05, 0.1, 0.2)))
        for off in (0.04, -0.04)
    )
    assert problem.light(bright) > 1.2 * problem.light(dark)
    assert problem.light(dark) > 0.1


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("count", COUNTS)
def test_there_is_a_start_for_each_number_of_lobes(preset, count):
    found = starts(load(preset), count, CYCLES)
    assert found
    assert {one.count for one in found} == {count}


def test_a_symmetric_curve_starts_with_pairs_at_its_plateaus():
    found = starts(load("silk_shot"), 4, CYCLES)
    tilts = {abs(lobe.tilt) for one in found for lobe in one.lobes if lobe.paired}
    assert any(tilt == pytest.approx(np.radians(25.0), abs=0.02) for tilt in tilts)


def test_pile_that_leans_starts_with_lobes_that_lean():
    found = starts(load("velvet"), 4, CYCLES)
    leaning = [lobe for one in found for lobe in one.lobes if lobe.along == 0 and lobe != flank(0)]
    assert all(lobe.tilt < -0.5 for lobe in leaning)
    assert not any(lobe.paired for lobe in leaning)


def test_starts_have_lobes_on_the_flanks_as_well():
    found = starts(load("linen_plain"), 4, CYCLES)
    of_one = [one for one in found if sum(flank(a) in one.lobes for a in (0, 1)) == 1]
    assert len(of_one) >= 2
    assert all(len(one.lobes) > 1 for one in of_one)


def test_a_fit_for_cycles_finds_which_lobes_are_gaussian():
    dim = {"color": (0.05, 0.1, 0.03)}
    wanted = mixture(CYCLES, replace(GAUSSIAN, **dim), replace(LEVEL, **dim))
    problem = problem_of(replace(wanted, view=()))
    begun = replace(turned(wanted, (0,)), view=())
    assert not any(one.gaussian for one in begun.lobes)
    assert problem.delta_e(begun) > 1.0
    found = min(_found(problem, [begun]), key=problem.score)
    assert [one.gaussian for one in found.lobes] == [True, False]
    assert problem.delta_e(found) < 0.1


@pytest.mark.parametrize("count", [0, 7])
def test_a_number_of_lobes_out_of_range_is_refused(count):
    with pytest.raises(FabricError, match="it must be from 1 to 6"):
        fit(load("velvet"), count)


@pytest.mark.parametrize("form", FORMS)
def test_a_mixture_grows_by_a_faint_pair(form):
    one = mixture(form)
    for more in grown(one):
        assert (more.form, more.count) == (form, one.count + 2)
        assert more.lobes[:-1] == one.lobes
        wi, wo = fitted_directions()
        added = evaluate(more, wi, wo) - evaluate(one, wi, wo)
        assert 0.0 < added.mean() < 0.1 * evaluate(one, wi, wo).mean()


@pytest.mark.exhaustive
def test_six_lobes_are_nearer_than_four():
    linen = load("linen_plain")
    judge = Judge(linen)
    four, six = (judge(fit(linen, count)) for count in (4, 6))
    assert six.delta_e < four.delta_e
    assert six.excess < 0.01


@pytest.mark.exhaustive
def test_fewer_lobes_are_taken_where_their_error_is_allowed():
    fabric = load("linen_plain")
    few = fit(fabric, 4, max_error=6.0)
    assert few.count < 4
    assert Judge(fabric)(few).delta_e < 6.0
    assert fit(fabric, 2, max_error=0.01).count == 2

"""No mixture is brighter than the cloth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.materials.lobes import known
from fabricusd.materials.lobes.bound import Bound
from fabricusd.materials.lobes.judge import Judge
from fabricusd.materials.lobes.mixture import CYCLES, FORMS, MATERIALX, POWERS, Mixture
from fabricusd.schema import load


@pytest.fixture(scope="module")
def linen():
    """(Bound, Judge) of one fabric; the judge looks from other views than the bound."""
    fabric = load("linen_plain")
    return Bound(fabric), Judge(fabric)


def brighter(mixture: Mixture, factor: float) -> Mixture:
    def times(rgb):
        return tuple(factor * c for c in rgb)

    return replace(
        mixture, diffuse=times(mixture.diffuse), sheen=times(mixture.sheen), view=(),
        lobes=tuple(replace(one, color=times(one.color)) for one in mixture.lobes),
    )  # fmt: skip


@pytest.mark.exhaustive
@pytest.mark.parametrize("form", FORMS)
def test_what_is_too_bright_becomes_as_bright_as_the_cloth(linen, form):
    bound, judge = linen
    bright = brighter(known.mixture_of(load("linen_plain"), 4, form), 1.4)
    assert judge(bright).excess > 0.4
    held = judge(bound(bright))
    assert held.excess <= 0.01
    # The bound holds in the worst view. In the mean there is little to be lost by it.
    assert all(abs(off) < 0.1 for off in held.sky_radiance.values())


@pytest.mark.exhaustive
def test_what_is_too_dark_is_as_bright_as_before(linen):
    bound, _ = linen
    one = known.mixture_of(load("linen_plain"), 4, CYCLES)
    dim, bright = bound(brighter(one, 0.5)), bound(brighter(one, 1.0))
    off = np.array(dim.view) - np.array(bright.view)
    # V is doubled, which adds to the first coefficient alone.
    assert bound.terms @ off == pytest.approx(np.log(2.0), abs=1e-6)


@pytest.mark.parametrize(
    "name",
    [
        "linen_plain",
        pytest.param("polyester_satin_charmeuse", marks=pytest.mark.exhaustive),
        pytest.param("velvet", marks=pytest.mark.exhaustive),
    ],
)
def test_the_table_is_nowhere_brighter_than_the_cloth(name):
    judge = Judge(load(name))
    for form in (CYCLES, MATERIALX):
        found = known.mixture_of(load(name), 4, form)
        assert judge(found).excess <= 0.01
        # Without V, each is.
        assert judge(replace(found, view=())).excess > 0.05


@pytest.mark.parametrize(("name", "polynomials"), [("linen_plain", 3), ("velvet", 5)])
def test_pile_that_leans_has_odd_terms_and_a_symmetric_cloth_none(name, polynomials):
    found = known.mixture_of(load(name), 4, CYCLES)
    assert len(found.view) == polynomials * POWERS

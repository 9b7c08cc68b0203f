"""Fits: they return the thread that made the lobes, and say what the lobes cannot tell."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.measure import fit_thread
from fabricusd.measure.angles import tilted
from fabricusd.measure.fit.parameters import volume_level
from tests.measure.shoots import DEGREE, FILAMENT, SPUN, WIDE, lobes_of

NUMBERS = ("ior", "isotropic", "gamma_surface", "gamma_volume")


def off(found, true):
    """Largest relative error of the numbers and the albedos."""
    pairs = [(getattr(found, n), getattr(true, n)) for n in NUMBERS]
    pairs += list(zip(found.albedo, true.albedo, strict=True))
    return max(abs(a / b - 1) for a, b in pairs)


@pytest.mark.parametrize("model", ["thesis", "microcylinder"])
@pytest.mark.parametrize("thread", [SPUN, FILAMENT], ids=["spun", "filament"])
def test_lobes_without_noise_give_the_thread_back(thread, model):
    found = fit_thread(lobes_of(thread, model=model, noise=0.0), model)
    assert off(found.thread, thread) < 1e-3
    assert found.thread.model == model
    assert found.chi2 < 1e-3


@pytest.mark.exhaustive
def test_the_conserving_model_is_fitted_with_a_gain_of_its_surface():
    thread = replace(SPUN, albedo=(0.2, 0.8, 0.9), surface_gain=3.0)
    found = fit_thread(lobes_of(thread, "coarse", "conserving", noise=0.0), "conserving")
    assert off(found.thread, thread) < 0.02
    assert found.thread.surface_gain == pytest.approx(3.0, rel=0.02)


def test_noise_that_is_known_gives_a_chi2_of_one():
    found = fit_thread(lobes_of(SPUN), "microcylinder")
    assert 0.85 < found.chi2 < 1.15
    assert found.freedom == found.values - 7
    assert found.notes == ()


def test_noise_that_is_larger_than_stated_widens_the_intervals_and_is_said():
    lobes = lobes_of(SPUN)
    as_stated = fit_thread(lobes, "microcylinder")
    short = fit_thread(replace(lobes, sigma=lobes.sigma / 3), "microcylinder")
    assert short.chi2 == pytest.approx(9 * as_stated.chi2, rel=1e-3)
    assert "worse than their deviations allow, by a factor of 3" in short.notes[0]
    for label in ("eta", "gs", "A red"):
        wide, narrow = short.estimates[label], as_stated.estimates[label]
        assert wide.high - wide.low == pytest.approx(narrow.high - narrow.low, rel=0.1)


def test_a_single_view_that_spoils_the_fit_is_named():
    lobes = lobes_of(SPUN)
    f = lobes.f.copy()
    f[20] *= 3
    found = fit_thread(replace(lobes, f=f), "microcylinder")
    view = f"theta_i {math.degrees(lobes.theta_i[20]):.4g}, theta_o "
    assert f"of chi2 is of the view {view}" in found.notes[0]
    assert "outlier" not in "".join(fit_thread(lobes, "microcylinder").notes)


def test_a_parameter_that_no_view_depends_on_is_said_to_be_free():
    found = fit_thread(lobes_of(replace(SPUN, albedo=(0, 0, 0)), noise=0.0), "microcylinder")
    assert found.thread.albedo == pytest.approx((0, 0, 0), abs=1e-5)
    gv = found.estimates["gv"]
    assert gv.high - gv.low > 45


def test_another_model_than_the_one_that_made_the_lobes_is_told_by_chi2():
    lobes = lobes_of(SPUN, model="thesis")
    right, wrong = (fit_thread(lobes, m).chi2 for m in ("thesis", "microcylinder"))
    assert right < 1.2
    assert wrong > 1.5 * right


def test_equal_seeds_give_equal_fits_however_many_workers():
    lobes = lobes_of(SPUN)
    fits = [fit_thread(lobes, "microcylinder", seed=3, workers=w) for w in (1, 3)]
    assert fits[0] == fits[1]


def test_parameters_that_cannot_be_told_apart_are_said_to_be_with_the_product_that_can():
    found = fit_thread(lobes_of(WIDE), "microcylinder")
    (note,) = found.notes
    assert note.startswith("gv, kd and A cannot be told apart by these views: gv from ")
    assert "A (kd + (1 - kd) g(gv, 0))" in note
    gv = found.estimates["gv"]
    assert gv.how == "profile"
    assert gv.high - gv.low > 20
    true = volume_level("microcylinder", WIDE.gamma_volume, WIDE.isotropic)
    assert len(found.products) == 3
    for product, albedo in zip(found.products, WIDE.albedo, strict=True):
        assert product.value == pytest.approx(albedo * true, rel=0.02)
        assert product.low <= albedo * true <= product.high
        assert product.spread < 0.5 * found.estimates["A red"].spread


def test_parameters_that_can_be_told_apart_have_no_products():
    found = fit_thread(lobes_of(SPUN), "microcylinder")
    assert found.products == ()
    assert all(e.how == "curvature" for e in found.estimates.values())


def test_a_single_incidence_refuses_a_free_gain_and_takes_a_fixed_one():
    lobes = lobes_of(SPUN, "incidence")
    with pytest.raises(FabricError) as error:
        fit_thread(lobes, "microcylinder", gain=True)
    assert "one incidence, 15 degrees, which cannot tell a free gain" in str(error.value)
    with pytest.raises(FabricError, match="one incidence"):
        fit_thread(replace(lobes, absolute=False), "microcylinder")
    assert fit_thread(lobes, "microcylinder").thread.ior == pytest.approx(1.46, abs=0.03)


def test_relative_lobes_free_the_gain_and_absolute_ones_fix_it():
    lobes = lobes_of(SPUN, noise=0.003)
    scaled = replace(lobes, f=2.5 * lobes.f, sigma=2.5 * lobes.sigma, absolute=False)
    found = fit_thread(scaled, "microcylinder")
    assert found.estimates["gain"].value == pytest.approx(2.5, rel=0.1)
    assert found.estimates["gain"].low < 2.5 < found.estimates["gain"].high
    assert "relative" in found.notes[-1]
    fixed = fit_thread(replace(scaled, absolute=True), "microcylinder")
    assert "gain" not in fixed.estimates
    assert fixed.chi2 > 10


def test_stray_light_is_found_as_an_offset_and_spoils_a_fit_without_one():
    lobes = lobes_of(SPUN, noise=0.01)
    stray = replace(lobes, f=lobes.f + np.array([0.004, 0.002, 0.001]))
    with_it = fit_thread(stray, "microcylinder", offset=True)
    for label, value in (("red", 0.004), ("green", 0.002), ("blue", 0.001)):
        estimate = with_it.estimates[f"offset {label}"]
        assert estimate.low < value < estimate.high
    assert with_it.chi2 < 1.2
    assert fit_thread(stray, "microcylinder").chi2 > 1.5


def test_a_thread_that_leans_is_found_to():
    from fabricusd.appearance.thread import evaluate

    lobes = lobes_of(SPUN, noise=0.0)
    angle = 1.5 * DEGREE
    leaning = replace(
        lobes, f=evaluate(SPUN, tilted(lobes.wi, angle), tilted(lobes.wo, angle), "microcylinder")
    )
    found = fit_thread(leaning, "microcylinder", lean=True)
    assert found.estimates["lean"].value == pytest.approx(1.5, abs=0.02)
    assert off(found.thread, SPUN) < 0.01


def test_a_thread_without_colour_has_an_albedo_of_zero_and_says_so():
    found = fit_thread(lobes_of(replace(SPUN, albedo=(0.0, 0.2, 0.3))), "microcylinder")
    assert found.thread.albedo[0] < 0.003
    assert all(a >= 0 for a in found.thread.albedo)


def test_what_cannot_be_fitted_is_refused():
    lobes = lobes_of(SPUN)
    with pytest.raises(FabricError, match="is 'lambert'; it must be one of thesis, microcylinder"):
        fit_thread(lobes, "lambert")
    with pytest.raises(FabricError, match="has 11 views; there must be at least 12"):
        fit_thread(lobes.of(np.arange(11)), "microcylinder")


def test_a_report_has_every_number_with_its_interval_as_text_and_as_json():
    found = fit_thread(lobes_of(WIDE), "microcylinder")
    text = "\n".join(found.lines())
    assert text.startswith("microcylinder: chi2/n ")
    assert "gv " in text
    assert "by profile" in text
    plain = found.as_json()
    assert plain["estimates"]["eta"]["low"] < plain["estimates"]["eta"]["value"]
    assert set(plain["products"]) == {p.label for p in found.products}
    assert math.isclose(plain["chi2_per_freedom"], found.chi2)

"""The value of a mixture, against identities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from materials.lobes.mixtures import LEVEL, PAIR, bare, directions, mixture

from fabricusd.materials.fit.judge import hemisphere
from fabricusd.materials.lobes.mixture import (
    CYCLES,
    FORMS,
    MATERIALX,
    POWERS,
    Mixture,
    evaluate,
    of_covered,
    reflected,
    view_factor,
)

PLAIN = replace(LEVEL, color=(1.0, 1.0, 1.0), facing=0.0, crossing=0.0, upright=0.0)


DISTRIBUTIONS = [(CYCLES, False), (CYCLES, True), (MATERIALX, False)]
"""Forms, and whether a lobe is Gaussian."""


@pytest.mark.parametrize(("form", "gaussian"), DISTRIBUTIONS)
@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_a_narrow_lobe_of_reflectance_one_reflects_all_light(form, gaussian, tilt):
    lights = hemisphere(40000)
    wo = np.tile([0.0, np.sin(0.2), np.cos(0.2)], (len(lights), 1))
    narrow = replace(PLAIN, tilt=tilt, alpha_along=0.05, alpha_across=0.08, gaussian=gaussian)
    got = evaluate(bare(form, narrow), lights, wo)
    assert got.mean(axis=0) * 2.0 * np.pi == pytest.approx([1.0] * 3, abs=0.02)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_mixture_of_pairs_is_its_own_mirror_image(axis):
    wi, wo = directions(200)
    flip = np.ones(3)
    flip[axis] = -1.0
    one = mixture(CYCLES)
    # The last polynomials of V are odd in the cosines to the weft and to the warp.
    one = replace(one, view=one.view[: 3 * POWERS])
    assert evaluate(one, wi * flip, wo * flip) == pytest.approx(evaluate(one, wi, wo))


def test_a_lobe_alone_is_not_its_own_mirror_image():
    wi, wo = directions(200)
    one = bare(CYCLES, replace(PAIR, paired=False))
    flip = np.array([-1.0, 1.0, 1.0])
    assert not np.allclose(evaluate(one, wi * flip, wo * flip), evaluate(one, wi, wo), rtol=0.1)


def test_a_pair_is_two_lobes():
    wi, wo = directions(200)
    apart = [bare(CYCLES, replace(PAIR, paired=False, tilt=t)) for t in (PAIR.tilt, -PAIR.tilt)]
    both = sum(evaluate(one, wi, wo) for one in apart)
    assert evaluate(bare(CYCLES, PAIR), wi, wo) == pytest.approx(both)
    assert mixture(CYCLES).count == 3


@pytest.mark.parametrize("form", FORMS)
def test_a_lobe_is_dark_below_its_own_plane(form):
    low = np.array([[-np.cos(0.3), 0.0, np.sin(0.3)]])
    up = np.array([[0.0, 0.0, 1.0]])
    one = bare(form, replace(PAIR, paired=False, tilt=0.5))
    assert not evaluate(one, low, up).any()
    assert not evaluate(one, up, low).any()
    assert evaluate(one, up, up).all()


@pytest.mark.parametrize(("form", "gaussian"), DISTRIBUTIONS)
def test_without_its_cosine_a_lobe_is_reciprocal(form, gaussian):
    wi, wo = directions(300)
    one = replace(LEVEL, gaussian=gaussian)
    there, back = (reflected(form, one, 0.3, (0.12, 0.2), *w) for w in ((wi, wo), (wo, wi)))
    assert there.value * there.facing == pytest.approx(back.value * back.facing)
    assert np.count_nonzero(there.value) > 200


def test_slopes_of_a_gaussian_lobe_have_the_variance_of_its_width():
    """Over halfway vectors, D h.n is a density whose slopes are normally distributed."""
    ax, ay = 0.3, 0.5
    one = replace(PLAIN, along=0, gaussian=True)
    h = hemisphere(100000)
    up = np.tile([0.0, 0.0, 1.0], (len(h), 1))
    wi = 2.0 * h[:, 2:] * h - up
    above = wi[:, 2] > 0.05
    h, wi, up = h[above], wi[above], up[above]
    got = reflected(CYCLES, one, 0.0, (ax, ay), wi, up)
    # No light is masked towards the normal, and none that is steep enough; just beyond, the
    # approximation of the masking is 1.0005.
    steep = (ax * wi[:, 0]) ** 2 + (ay * wi[:, 1]) ** 2 < 0.39 * wi[:, 2] ** 2
    x, y = h[:, 0] / h[:, 2], h[:, 1] / h[:, 2]
    density = np.exp(-((x / ax) ** 2) - (y / ay) ** 2) / (np.pi * ax * ay)
    assert 4.0 * got.value[steep] * h[steep, 2] ** 4 == pytest.approx(density[steep])
    assert (4.0 * got.value * h[:, 2] ** 4 < 1.001 * density)[~steep].all()
    assert min(np.count_nonzero(~steep), np.count_nonzero(steep)) > 1000


def test_the_forms_differ_where_a_lobe_is_anisotropic():
    wi, wo = directions(200)
    two = [evaluate(mixture(form), wi, wo) for form in FORMS]
    assert np.abs(two[0] - two[1]).mean() > 0.02 * two[0].mean()


def test_the_diffuse_part_is_lambert_without_its_power():
    wi, wo = directions(50)
    one = Mixture(
        form=CYCLES, lobes=(), diffuse=(0.2, 0.4, 0.6), diffuse_power=0.0, sheen=(0.0,) * 3,
        sheen_roughness=0.5, sheen_power=0.0,
    )  # fmt: skip
    assert evaluate(one, wi, wo) == pytest.approx(wi[:, 2:] / np.pi * np.array([[0.2, 0.4, 0.6]]))


def test_the_factor_of_the_view_multiplies_all_of_a_mixture():
    wi, wo = directions(200)
    one = mixture(CYCLES)
    v = view_factor(one, wo)
    assert v.max() > 1.2 * v.min() > 0.0
    without = evaluate(replace(one, view=()), wi, wo)
    assert evaluate(one, wi, wo) == pytest.approx(v[:, None] * without)


def test_sheen_is_weighted_by_the_viewer():
    wi, wo = directions(100)
    even = replace(mixture(CYCLES), lobes=(), diffuse=(0.0,) * 3, sheen_power=0.0)
    fades = replace(even, sheen_power=2.0)
    upright = np.maximum(wo[:, 2:], 0.05)
    assert evaluate(fades, wi, wo) == pytest.approx(upright**2 * evaluate(even, wi, wo))


def test_an_opacity_dims_the_mixture_of_covered_cloth_to_the_whole():
    wi, wo = directions(64)
    for one in (mixture(CYCLES), replace(mixture(CYCLES), view=())):
        dimmed = 0.7 * evaluate(of_covered(one, 0.7), wi, wo)
        assert np.allclose(dimmed, evaluate(one, wi, wo), rtol=1e-9)

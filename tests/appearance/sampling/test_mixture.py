"""The surface's sampler against the density it claims, and against uniform directions."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from fabricusd.appearance import surface
from fabricusd.appearance.sampling.lobes import (
    THREAD_LOBES,
    lobe_densities,
    sample_lobe,
    theta_range,
)
from fabricusd.appearance.sampling.stretches import Stretch
from fabricusd.appearance.weave.coverage import WARP
from fabricusd.fabric import MODELS
from tests.appearance.chi_squared import threshold
from tests.appearance.directions import VIEWS, cell_of, direction, random_directions, sphere_cells
from tests.appearance.presets import LINEN, PRESETS, often, with_model

R = np.float64
LEVELS = surface.LEVELS
ROWS = [(n, m, v) for n in PRESETS for m in MODELS for v in LEVELS]
CHI_SQUARED_ROWS = [(*row, list(VIEWS)[k % len(VIEWS)]) for k, row in enumerate(ROWS)]
ERROR_RATE = 0.01
"""Chance that one of the chi-squared rows fails although the sampler is right."""
DRAWN = 60_000
PLACES = ((0.3, 0.45), (0.62, 0.52), (1.48, 0.2), (2.5, 1.7))
"""Weave coordinates; on every preset the first lies on a thread."""


def uniform(n, seed):
    return np.random.default_rng(seed).random((n, 3))


def two_sided(fabric):
    return fabric.model == "conserving" and not fabric.opaque


def chi_squared(fabric, level, wo, samples, density_of=None):
    """p-value of drawn directions against the density, over cells of the sphere."""
    wi, weights = sphere_cells(nodes=14, lower=two_sided(fabric))
    density_of = density_of or fabric
    p = surface.pdf(density_of, wi.reshape(-1, 3), wo, uv=PLACES[0], level=level)
    expected = (p.reshape(weights.shape) * weights).sum(axis=1) * len(samples)
    observed = np.bincount(cell_of(samples), minlength=len(expected)).astype(float)
    assert len(observed) == len(expected), "drawn on a side that the density does not have"
    few = expected < 10
    expected = np.append(expected[~few], max(expected[few].sum(), 1e-9))
    observed = np.append(observed[~few], observed[few].sum())
    if expected[-1] < 10:
        expected[0], observed[0] = expected[0] + expected[-1], observed[0] + observed[-1]
        expected, observed = expected[:-1], observed[:-1]
    return stats.chi2.sf(((observed - expected) ** 2 / expected).sum(), len(expected) - 1)


@pytest.mark.parametrize(("name", "model", "level", "view"), often(CHI_SQUARED_ROWS, LINEN))
def test_samples_follow_the_density(name, model, level, view):
    fabric, wo = with_model(PRESETS[name], model), VIEWS[view]
    drawn = surface.sample(fabric, wo, uniform(DRAWN, 7), uv=PLACES[0], level=level)
    p = chi_squared(fabric, level, wo, drawn.wi)
    assert p > threshold(ERROR_RATE, len(CHI_SQUARED_ROWS))


@pytest.mark.parametrize("model", MODELS)
def test_samples_do_not_follow_the_density_of_a_lobe_five_per_cent_wider(model):
    fabric, wo = with_model(PRESETS["silk_shot"], model), VIEWS["slanting"]
    wrong = replace(
        fabric,
        threads={
            k: replace(t, gamma_surface=1.05 * t.gamma_surface, gamma_volume=1.05 * t.gamma_volume)
            for k, t in fabric.threads.items()
        },
    )
    drawn = surface.sample(fabric, wo, uniform(5 * DRAWN, 7), uv=PLACES[0], level="weave")
    p = chi_squared(fabric, "weave", wo, drawn.wi, density_of=wrong)
    assert p < 0.01 * threshold(ERROR_RATE, len(CHI_SQUARED_ROWS))


@pytest.mark.parametrize(("name", "model", "level"), often(ROWS))
def test_the_density_integrates_to_one(name, model, level):
    fabric = with_model(PRESETS[name], model)
    wi, weights = sphere_cells(nodes=16, lower=two_sided(fabric))
    for wo in VIEWS.values():
        p = surface.pdf(fabric, wi.reshape(-1, 3), wo, uv=PLACES[0], level=level)
        assert p @ weights.ravel() == pytest.approx(1.0, abs=2e-3)


def stretch(psi0: float, surface_width: float, volume_width: float) -> Stretch:
    """A warp thread at one tangent angle [rad], with the deviations of its lobes [rad]."""
    c, s = math.cos(psi0), math.sin(psi0)
    return Stretch(WARP, psi0, c, s, math.tan(psi0), surface_width, volume_width)


@pytest.mark.parametrize("psi0", [0.0, 0.3, -0.9, 1.5, -1.5])
@pytest.mark.parametrize("theta_o", [0.0, 0.7, -1.4])
def test_each_lobe_integrates_to_one_in_its_own_frame(psi0, theta_o):
    low, high = theta_range(R, psi0)
    x, wx = np.polynomial.legendre.leggauss(600)
    y, wy = np.polynomial.legendre.leggauss(16)
    # The substitution theta(turn) is level at both ends of the range, where the azimuths' limit
    # bends without end.
    turn = 0.5 * math.pi * (x + 1)
    theta = 0.5 * (low + high) - 0.5 * (high - low) * np.cos(turn)
    weight = wx * 0.25 * math.pi * (high - low) * np.sin(turn)
    total = np.zeros(THREAD_LOBES)
    for t, wt in zip(theta, weight, strict=True):
        limit = math.acos(min(max(math.tan(t) * math.tan(psi0), 0.0), 1.0))
        for f, wf in zip(0.5 * limit * (y + 1), wy * limit, strict=True):
            c = math.cos(t)
            d = lobe_densities(
                R, stretch(psi0, 0.17, 0.4), theta_o, math.sin(t), c * math.sin(f), c * math.cos(f)
            )
            total += np.array(d) * c * wt * wf
    assert total == pytest.approx(np.ones(THREAD_LOBES), abs=1e-6)


@pytest.mark.parametrize("lobe", range(THREAD_LOBES))
@pytest.mark.parametrize("psi0", [0.0, 0.6, -1.2, 1.56])
@pytest.mark.parametrize("theta_o", [0.0, 1.5, -1.5])
def test_a_lobe_never_draws_below_the_cloth_or_behind_its_thread(lobe, psi0, theta_o):
    for u1 in (0.0, 1e-9, 0.3, 0.999999, 1.0):
        for u2 in (0.0, 0.5, 1.0):
            t, b, n = sample_lobe(R, lobe, stretch(psi0, 0.2, 0.2), theta_o, u1, u2)
            assert t * t + b * b + n * n == pytest.approx(1.0, abs=1e-12)
            assert n >= 0.0
            assert math.cos(psi0) * n - math.sin(psi0) * t >= -1e-9


def relative_variance(fabric, level, wo, uv, n=3000):
    """(uniform, drawn): variance over mean^2 of the estimates of one view under an even sky."""
    drawn = surface.sample(fabric, wo, uniform(n, 1), uv=uv, level=level)
    estimate = np.divide(drawn.f.mean(axis=1), drawn.pdf, out=np.zeros(n), where=drawn.pdf > 0)
    both = two_sided(fabric)
    wi = random_directions(n, 2, upper=not both)
    even = surface.evaluate(fabric, wi, wo, uv=uv, level=level).mean(axis=1)
    even = even * (4 * math.pi if both else 2 * math.pi)
    mean = 0.5 * (estimate.mean() + even.mean())
    if mean <= 0:
        return 0.0, 0.0
    return even.var() / mean**2, estimate.var() / mean**2


def largest_variance(name, model, level):
    """The share of uniform directions' variance that drawing may leave, MODEL section 9.4, which
    has none for level `thread`."""
    if level == "thread":
        return 0.6
    if name == "velvet":
        return 0.2
    return 0.7 if level == "far" else 0.4


@pytest.mark.parametrize(("name", "model", "level"), often(ROWS, LINEN))
def test_drawing_by_the_lobes_leaves_less_variance_than_uniform_directions(name, model, level):
    fabric = with_model(PRESETS[name], model)
    views = [*VIEWS.values(), direction(75, 0), direction(25, 300)]
    places = PLACES[:1] if level == "far" else PLACES[:3]
    # At `thread` a view's variance may lie in a few directions out of ten thousand.
    count = 30_000 if level == "thread" else 3_000
    found = [relative_variance(fabric, level, wo, uv, count) for wo in views for uv in places]
    even, drawn = np.mean(found, axis=0)
    assert drawn <= largest_variance(name, model, level) * even


def test_the_variance_bound_bites_on_a_sampler_that_ignores_the_viewer():
    fabric = PRESETS["velvet"]
    wo = VIEWS["slanting"]
    mirrored = wo * (-1, -1, 1)
    even, _ = relative_variance(fabric, "far", wo, PLACES[0])
    drawn = surface.sample(fabric, mirrored, uniform(3000, 1))
    f = surface.evaluate(fabric, drawn.wi, wo).mean(axis=1)
    estimate = np.divide(f, drawn.pdf, out=np.zeros(3000), where=drawn.pdf > 0)
    assert estimate.var() / estimate.mean() ** 2 > 0.2 * even


def test_a_gap_is_sampled_evenly_and_reflects_nothing():
    drawn = surface.sample(
        PRESETS["linen_plain"], VIEWS["slanting"], uniform(500, 3), uv=(0.01, 0.02), level="weave"
    )
    assert (drawn.f == 0).all()
    assert drawn.pdf == pytest.approx(np.full(500, 0.5 / math.pi))


@pytest.mark.parametrize("level", LEVELS)
def test_mixed_cloth_is_drawn_from_both_samplers(level):
    fabric = PRESETS["silk_shot"]
    warp = replace(fabric.threads["Warp"], model="conserving")
    mixed = replace(fabric, threads={"Warp": warp, "Weft": fabric.threads["Weft"]})
    wi, weights = sphere_cells(nodes=24, lower=True)
    for wo in (VIEWS["slanting"], -VIEWS["slanting"]):
        p = surface.pdf(mixed, wi.reshape(-1, 3), wo, uv=PLACES[0], level=level)
        assert p @ weights.ravel() == pytest.approx(1.0, abs=2e-3)
        drawn = surface.sample(mixed, wo, uniform(DRAWN, 5), uv=PLACES[0], level=level)
        assert (drawn.pdf > 0).mean() > 0.999
        shares = np.bincount(cell_of(drawn.wi), minlength=len(weights)) / DRAWN
        expected = (p.reshape(weights.shape) * weights).sum(axis=1)
        assert shares == pytest.approx(expected, abs=5 * math.sqrt(0.25 / DRAWN))

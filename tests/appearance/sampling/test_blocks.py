"""The samplers of many hits at a time are those of one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from appearance.presets import with_model

from fabricusd.appearance.conserving.multiple import conserving_tables
from fabricusd.appearance.conserving.shares import conserving_mixture
from fabricusd.appearance.published.shares import published_mixture
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.sampling.blocks import (
    Drawn,
    sample_far,
    sample_far_both,
    sample_points,
    sample_points_both,
)
from fabricusd.appearance.sampling.mixture import density as far_density
from fabricusd.appearance.sampling.mixture import direction as far_direction
from fabricusd.appearance.sampling.mixture import point_density, point_direction
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.appearance.weave.place import Place, Places
from fabricusd.schema import load

PRESETS = ("linen_plain", "polyester_satin_charmeuse", "silk_shot", "velvet")
CONSERVING = {
    "linen_plain": with_model(load("linen_plain"), "conserving"),
    "velvet": with_model(load("velvet"), "conserving"),
    "denim": load("denim"),
    "opaque denim": replace(load("denim"), opaque=True),
}
R = np.float32


def views(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    made = []
    for _ in range(2):
        w = rng.normal(size=(3, count))
        w[2] = np.abs(w[2])
        made.append(np.ascontiguousarray(w / np.linalg.norm(w, axis=0), R))
    made[1][2, ::7] *= -1
    return made[0], made[1], rng.random((3, count)).astype(R)


@pytest.mark.parametrize("preset", PRESETS)
def test_the_far_sampler_draws_the_same_directions_with_the_same_densities(preset):
    fabric = load(preset)
    tables = surface_tables(fabric, precision=R)
    sampling = published_mixture(fabric, tables)
    wo, wi, u = views(700)
    go, p_light, p_go = np.empty_like(wo), np.empty(705, R), np.empty(705, R)
    rows = [np.concatenate([np.zeros(5, R), row]) for row in u]
    sample_far(R, sampling, wo, wi, tuple(rows), Drawn(go, p_light, p_go), 5, 700)
    for k in range(700):
        one = far_direction(R, sampling, *wo[:, k], *u[:, k])
        assert go[:, k] == pytest.approx(one, abs=2e-5)
        expected = far_density(R, sampling, *go[:, k], *wo[:, k])
        assert p_go[5 + k] == pytest.approx(expected, rel=2e-3, abs=1e-5)
        expected = far_density(R, sampling, *wi[:, k], *wo[:, k])
        assert p_light[5 + k] == pytest.approx(expected, rel=2e-3, abs=1e-5)


@pytest.mark.parametrize("across_too", [False, True])
@pytest.mark.parametrize("preset", PRESETS)
def test_the_sampler_at_a_point_does_too_and_gaps_are_uniform(preset, across_too):
    fabric = load(preset)
    tables = surface_tables(fabric, precision=R)
    sampling = published_mixture(fabric, tables)
    wo, wi, u = views(700)
    hit = lookup(fabric, np.random.default_rng(1).uniform(0, 40, (700, 2)))
    psi0 = hit.angle.astype(R)
    go, p_light, p_go = np.empty_like(wo), np.empty(700, R), np.empty(700, R)
    w = hit.across.astype(R)
    sample_points(
        R, tables.threads, sampling, across_too, Places(hit.set, hit.thread, psi0, w), wo, wi,
        tuple(u), Drawn(go, p_light, p_go), 0, 700,
    )  # fmt: skip
    for k in range(700):
        at = (across_too, Place(int(hit.set[k]), int(hit.thread[k]), psi0[k], w[k]))
        one = point_direction(R, tables.threads, sampling, *at, *wo[:, k], *u[:, k])
        assert go[:, k] == pytest.approx(one, abs=2e-5)
        for direction, density in ((go, p_go), (wi, p_light)):
            expected = point_density(R, tables.threads, sampling, *at, *direction[:, k], *wo[:, k])
            assert density[k] == pytest.approx(expected, rel=2e-3, abs=1e-5)


def _everywhere(count):
    """Viewers, lights and numbers, on both sides of the cloth."""
    rng = np.random.default_rng(3)
    w = rng.normal(size=(2, 3, count))
    w = np.ascontiguousarray(w / np.linalg.norm(w, axis=1, keepdims=True), R)
    return w[0], w[1], rng.random((3, count)).astype(R)


@pytest.mark.parametrize("name", CONSERVING)
def test_the_far_sampler_of_two_sides_is_that_of_one_hit(name):
    fabric = CONSERVING[name]
    sampling = conserving_mixture(fabric, conserving_tables(fabric, precision=R))
    wo, wi, u = _everywhere(700)
    go, p_light, p_go = np.empty_like(wo), np.empty(705, R), np.empty(705, R)
    rows = [np.concatenate([np.zeros(5, R), row]) for row in u]
    sample_far_both(R, sampling, wo, wi, tuple(rows), Drawn(go, p_light, p_go), 5, 700)
    for k in range(700):
        assert go[:, k] == pytest.approx(far_direction(R, sampling, *wo[:, k], *u[:, k]), abs=2e-5)
        for direction, density in ((go, p_go), (wi, p_light)):
            expected = far_density(R, sampling, *direction[:, k], *wo[:, k])
            assert density[5 + k] == pytest.approx(expected, rel=2e-3, abs=1e-5)
    assert (p_light[5:] == 0).any() == fabric.opaque


@pytest.mark.parametrize("across_too", [False, True])
@pytest.mark.parametrize("name", CONSERVING)
def test_the_sampler_of_two_sides_at_a_thread_is_that_of_one_hit(name, across_too):
    fabric = CONSERVING[name]
    tables = conserving_tables(fabric, precision=R)
    sampling = conserving_mixture(fabric, tables)
    wo, wi, u = _everywhere(700)
    hit = lookup(fabric, np.random.default_rng(1).uniform(0, 40, (700, 2)))
    psi0, w = hit.angle.astype(R), hit.across.astype(R)
    go, p_light, p_go = np.empty_like(wo), np.empty(700, R), np.empty(700, R)
    sample_points_both(
        R, tables.threads, sampling, across_too, Places(hit.set, hit.thread, psi0, w), wo, wi,
        tuple(u), Drawn(go, p_light, p_go), 0, 700,
    )  # fmt: skip
    for k in np.flatnonzero(hit.set < 2):
        at = (across_too, Place(int(hit.set[k]), int(hit.thread[k]), psi0[k], w[k]))
        one = point_direction(R, tables.threads, sampling, *at, *wo[:, k], *u[:, k])
        assert go[:, k] == pytest.approx(one, abs=2e-5)
        for direction, density in ((go, p_go), (wi, p_light)):
            expected = point_density(R, tables.threads, sampling, *at, *direction[:, k], *wo[:, k])
            assert density[k] == pytest.approx(expected, rel=2e-3, abs=1e-5)

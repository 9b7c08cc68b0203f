"""The fuzz of hairy threads: reciprocal, passive, the same mean at every level, gone without it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fabricusd.appearance.fuzz import (
    FIBRE,
    albedo_weights,
    bald,
    fibres_of,
    fuzz_over_all,
    gathered_at,
    optical_depth,
    to_and_fro,
)
from fabricusd.appearance.layer import layer_of
from fabricusd.appearance.plain import white
from fabricusd.appearance.surface import evaluate, fuzz_of, mean_shadow, sample
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.fabric import Fabric, even
from fabricusd.schema import load

Floats = NDArray[np.float64]


def hairy(fabric: Fabric, hairiness: float) -> Fabric:
    threads = {n: replace(t, hairiness=hairiness) for n, t in fabric.threads.items()}
    return replace(fabric, threads=threads)


def directions(count: int, seed: int = 0, steepest: float = 85.0) -> Floats:
    rng = np.random.default_rng(seed)
    z = np.cos(np.radians(rng.uniform(0, steepest, count)))
    turn = rng.uniform(0, 2 * math.pi, count)
    flat = np.sqrt(1 - z * z)
    return np.stack((flat * np.cos(turn), flat * np.sin(turn), z), axis=-1)


def white_sky(fabric: Fabric, mu: float, polar: int = 32, around: int = 64) -> Floats:
    """(2, 3) what a viewer at `mu` receives from above and from below, gaps left out."""
    x, w = np.polynomial.legendre.leggauss(polar)
    phi = (np.arange(around) + 0.5) * (2 * math.pi / around)
    z, turn = (a.ravel() for a in np.meshgrid(0.5 * (x + 1), phi, indexing="ij"))
    flat = np.sqrt(1 - z * z)
    above = np.stack((flat * np.cos(turn), flat * np.sin(turn), z), axis=-1)
    weight = np.repeat(0.5 * w, around) * (2 * math.pi / around)
    wo = np.array([0.8 * math.sqrt(1 - mu * mu), 0.6 * math.sqrt(1 - mu * mu), mu])
    shadow = mean_shadow(fabric)
    return np.stack(
        [weight @ evaluate(fabric, w, wo, shadow=shadow) for w in (above, above * [1, 1, -1])]
    )


def test_a_fabric_without_hairiness_has_no_fuzz() -> None:
    assert fuzz_of(load("linen_plain"), np.float64) is None
    assert optical_depth(load("organza")) == 0


def test_the_optical_depth_is_that_of_the_fibres_on_one_face() -> None:
    fabric = hairy(load("linen_plain"), 2.0)
    per_metre = fabric.warp.density + fabric.weft.density
    assert optical_depth(fabric) == pytest.approx(math.pi / 4 * FIBRE * 0.5 * 2.0 * per_metre)


def test_the_kernel_is_the_formula() -> None:
    fabric = hairy(load("denim"), 4.0)
    fuzz = fuzz_of(fabric, np.float64)
    assert fuzz is not None
    wi, wo = directions(200, 1), directions(200, 2)
    beneath = np.random.default_rng(3).random((3, 200))
    out = beneath.copy()
    fuzz_over_all(np.float64, *fuzz, np.array([1]), wi.T.copy(), wo.T.copy(), out)
    tau = optical_depth(fabric)
    mu_i, mu_o = wi[:, 2], wo[:, 2]
    angle = np.arccos(np.clip((wi * wo).sum(axis=1), -1, 1))
    e = mu_i / (mu_i + mu_o) * (1 - np.exp(-tau / mu_i - tau / mu_o))
    for c in range(3):
        at = np.linspace(0, math.pi, len(fuzz.phase[1]))
        p = np.interp(angle, at, fuzz.phase[1, :, c])
        kept = np.ones(200)
        for mu in (mu_i, mu_o):
            up = np.interp(mu, np.linspace(0, 1, len(fuzz.up)), fuzz.up[:, c])
            kept *= 1 - (1 - np.exp(-tau / mu)) * (fuzz.lost[c] + up)
        np.testing.assert_allclose(
            out[c], p * e + beneath[c] * kept * fuzz.again[0, c], rtol=1e-6, atol=1e-9
        )


@pytest.mark.parametrize("name", ["cotton_poplin", "linen_plain{appearance=published}"])
def test_fuzz_is_reciprocal(name: str) -> None:
    fabric = hairy(load(name), 6.0)
    fuzz = fuzz_of(fabric, np.float64)
    assert fuzz is not None
    wi, wo = directions(300, 4), directions(300, 5)
    found = []
    for i, o in ((wi, wo), (wo, wi)):
        # Cloth that is the same both ways, so that only the fuzz is asked.
        out = np.repeat(i[None, :, 2], 3, axis=0) / math.pi
        fuzz_over_all(np.float64, *fuzz, np.array([0]), i.T.copy(), o.T.copy(), out)
        found.append(out / i[None, :, 2])
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9)


@pytest.mark.parametrize("hairiness", [1.5, 6.0, 12.0])
@pytest.mark.parametrize("name", ["cotton_poplin", "denim", "linen_plain"])
def test_fuzz_hands_back_no_more_than_it_takes(name: str, hairiness: float) -> None:
    fabric = load(name)
    if name == "linen_plain":
        fabric = load("linen_plain{appearance=conserving}")
    fabric = white(hairy(fabric, hairiness))
    for degrees in (0, 30, 60, 75, 85, 89.5):
        mu = math.cos(math.radians(degrees))
        assert white_sky(fabric, mu).sum(axis=0).max() < 1.003, degrees


def test_white_fibres_on_white_cloth_lose_little() -> None:
    bald = white(load("cotton_poplin"))
    bald = hairy(bald, 0.0)
    for hairiness in (1.5, 6.0):
        for degrees in (0, 45, 75):
            mu = math.cos(math.radians(degrees))
            lost = (white_sky(bald, mu) - white_sky(hairy(bald, hairiness), mu)).sum(axis=0)
            assert abs(lost).max() < 0.005
    # That the comparison can fail: without what goes to and fro, a fortieth is lost.
    fuzz = fuzz_of(hairy(bald, 6.0), np.float64)
    assert fuzz is not None
    assert (fuzz.again > 1.025).all()


def test_fuzz_shows_at_grazing_views() -> None:
    fabric = load("cotton_poplin")
    change = {
        degrees: float(
            white_sky(hairy(fabric, 6.0), math.cos(math.radians(degrees)))[0, 0]
            / white_sky(hairy(fabric, 0.0), math.cos(math.radians(degrees)))[0, 0]
        )
        for degrees in (0, 80)
    }
    assert change[80] > 1.1
    assert 0.98 < change[0] < 1.05


@pytest.mark.parametrize("name", ["denim", "gauze", "silk_shot{appearance=published}"])
def test_the_mean_over_the_repeat_is_level_far(name: str) -> None:
    fabric = even(hairy(load(name), 5.0))
    wi, wo = directions(6, 6, 70), directions(6, 7, 70)
    even_places = np.arange(1 << 14)[:, None] * [0.7548776662466927, 0.5698402909980532] % 1.0
    uv = even_places * true_repeat(fabric)
    fuzz = fuzz_of(fabric, np.float64)
    assert fuzz is not None
    bare = bald(fabric)
    far, beneath = evaluate(fabric, wi, wo), evaluate(bare, wi, wo)
    kept = np.ones((3, len(wi)))
    fuzz_over_all(np.float64, *fuzz, np.array([-1]), wi.T.copy(), wo.T.copy(), kept)
    for k in range(len(wi)):
        light = np.repeat(wi[k : k + 1], len(uv), axis=0)
        near, under = (evaluate(f, light, wo[k], uv, "weave") for f in (fabric, bare))
        # Only what the fuzz adds: the mean of the cloth beneath is tested elsewhere.
        added = (near - kept[:, k] * under).mean(axis=0)
        np.testing.assert_allclose(added, far[k] - kept[:, k] * beneath[k], rtol=0.01)


def test_a_gap_has_no_fibres() -> None:
    fabric = hairy(load("gauze"), 6.0)
    fuzz = fuzz_of(fabric, np.float64)
    assert fuzz is not None
    out = np.zeros((3, 1))
    up = np.array([[0.0], [0.0], [1.0]])
    fuzz_over_all(np.float64, *fuzz, np.array([-1]), up, up, out)
    assert (out == 0).all()
    fuzz_over_all(np.float64, *fuzz, np.array([0]), up, up, out)
    assert (out > 0).all()


def test_sampled_directions_reach_all_of_the_fuzz() -> None:
    fabric = hairy(load("cotton_poplin"), 6.0)
    mu = math.cos(math.radians(80))
    wo = np.array([math.sqrt(1 - mu * mu), 0.0, mu])
    drawn = sample(fabric, wo, np.random.default_rng(8).random((40000, 3)))
    weight = drawn.f[drawn.pdf > 0] / drawn.pdf[drawn.pdf > 0, None]
    estimate = weight.sum(axis=0) / 40000
    x, w = np.polynomial.legendre.leggauss(48)
    phi = (np.arange(96) + 0.5) * (2 * math.pi / 96)
    z, turn = (a.ravel() for a in np.meshgrid(x, phi, indexing="ij"))
    flat = np.sqrt(1 - z * z)
    wi = np.stack((flat * np.cos(turn), flat * np.sin(turn), z), axis=-1)
    true = (np.repeat(w, 96) * (2 * math.pi / 96)) @ evaluate(fabric, wi, wo)
    np.testing.assert_allclose(estimate, true, rtol=0.02)
    assert weight.max() < 30


@pytest.mark.parametrize("name", ["cotton_poplin", "denim"])
def test_the_colour_of_hairy_cloth_is_that_of_its_law(name: str) -> None:
    fabric = hairy(load(name), 5.0)
    layer = layer_of(fabric)
    shares = layer.of(np.array([t.albedo for t in fabric.thread_list]))
    found = white_sky(fabric, math.cos(math.radians(8)))
    np.testing.assert_allclose(shares[0, 0], found[0], atol=2.5e-3)
    np.testing.assert_allclose(shares[0, 1] - layer.gap[0], found[1], atol=2.5e-3)


def test_fibres_absorb_as_their_thread_does() -> None:
    fibres = fibres_of(hairy(load("cotton_poplin"), 2.0))
    assert fibres is not None
    surface, volume = (float(albedo_weights() @ p[0]) for p in (fibres.surface, fibres.volume))
    assert surface + volume == pytest.approx(1.0, abs=2e-3)
    assert 0.02 < surface < 0.2


def test_what_goes_to_and_fro_is_a_series() -> None:
    reflected, through, fuzz = 0.5, 0.3, 0.2
    matrix = fuzz * np.array([[reflected, through], [through, reflected]])
    hits = np.linalg.inv(np.eye(2) - matrix)[:, 0]
    again = to_and_fro(np.array([[reflected], [through]]), np.array([fuzz]))
    sent = np.array([[reflected, through], [through, reflected]]) @ hits
    np.testing.assert_allclose(again[:, 0], sent / [reflected, through])


def test_a_viewer_at_the_horizon_sees_fuzz_alone() -> None:
    even = np.full(33, 1 / (4 * math.pi))
    # Half of what isotropic fibres scatter goes up; all of it was met, at the horizon.
    assert float(gathered_at(0.1, 0.0) @ even) == pytest.approx(0.5, abs=1e-3)

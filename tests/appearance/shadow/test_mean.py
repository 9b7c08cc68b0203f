"""The mean shadow of level `far`: how nodes take it, and its table."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.appearance.laws.lit import AZIMUTHS, ROWS
from fabricusd.appearance.shadow.mean import node_means
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.surface import evaluate
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.quadrature import CELLS, POINTS, Rule, curve_nodes, shares
from fabricusd.fabric import even
from fabricusd.schema import load

CUTS = np.array([0.0, 0.07, 0.3, 0.55, 0.8, 1.0])
"""Ends of the stretches on which the factor is constant."""


@pytest.fixture(scope="module")
def nodes():
    """Of a curve with one piece and 9 points."""
    return curve_nodes(load("linen_plain"), Rule(POINTS, 1.0))


def mine(nodes):
    return np.arange(nodes.warp_start)


def test_points_integrate_a_polynomial_times_steps(nodes):
    here = mine(nodes)
    part = shares(nodes, here, CUTS)
    weight = nodes.weight[here] / nodes.weight[here].sum()
    # Places of the points along the curve, from 0 to 1: its angle is linear there.
    psi0 = nodes.psi0[here]
    at = np.interp(psi0, [-psi0.max(), psi0.max()], [-1, 1])
    x = np.polynomial.legendre.leggauss(len(here))[0]
    assert np.allclose(abs(at), abs(x / x.max()), atol=1e-12)
    place = 0.5 + 0.5 * x
    for power in range(len(here)):
        exact = np.diff(CUTS ** (power + 1)) / (power + 1)
        assert np.allclose((weight * place**power) @ part, exact, atol=1e-12)


@pytest.mark.parametrize("rule", [Rule(POINTS, 1.0), Rule(POINTS, 0.05), Rule(CELLS, 0.1)])
@pytest.mark.parametrize("name", ["linen_plain", "polyester_satin_charmeuse"])
def test_every_node_stands_for_the_whole_of_itself(name, rule):
    nodes = curve_nodes(load(name), rule)
    assert np.all(np.diff(nodes.panel) >= 0)
    here = mine(nodes)
    part = shares(nodes, here, CUTS)
    assert np.allclose(part.sum(axis=1), 1.0)
    weight = nodes.weight[here] / nodes.weight[here].sum()
    assert np.allclose(weight @ part, np.diff(CUTS))


def test_cells_take_their_own_range():
    nodes = curve_nodes(load("linen_plain"), Rule(CELLS, 0.1))
    here = mine(nodes)
    part = shares(nodes, here, CUTS)
    ends = np.linspace(0.0, 1.0, len(here) + 1)
    low, high = (np.maximum(CUTS[:-1], ends[:-1, None]), np.minimum(CUTS[1:], ends[1:, None]))
    assert np.allclose(part, np.maximum(high - low, 0.0) * len(here))


def test_the_table_ends_where_light_comes_from_above():
    fabric = load("silk_crepe_de_chine")
    shadow = compile_shadow(fabric, "horizon", precision=np.float64)
    nodes = curve_nodes(fabric)
    table = node_means(shadow, nodes, fabric)
    assert table.shape == (AZIMUTHS + 1, ROWS, len(nodes.psi0))
    assert np.allclose(table[:, -1], 1.0)
    assert np.allclose(table[0], table[-1])
    # At the cloth itself the edges of shadows let half of the light of level places through.
    assert np.all(table[:, 0] < 0.6)


def test_no_pair_of_directions_is_darker_than_black():
    fabric = load("silk_crepe_de_chine")
    rng = np.random.default_rng(5)
    n = 1 << 16
    z, turn = rng.random((2, n)) ** 1.5, 2.0 * np.pi * rng.random((2, n))
    flat = np.sqrt(1.0 - z * z)
    wi, wo = np.stack((flat * np.cos(turn), flat * np.sin(turn), z), axis=-1)
    value = evaluate(fabric, wi, wo, shadow="horizon")
    assert value.min() == 0.0
    assert np.mean(value == 0.0) < 1e-3


# With the mean of each node's own part of the curve, filament is off by .02 to .04; crepe by .015
# with lines between samples of the mean, and satin's back by .011 with 1024 places of a stretch.
# Crepe's blue, an eighth of its red, is .02 off in one of these views (docs/shadowing.md).
@pytest.mark.parametrize(
    ("name", "elevation", "azimuth", "channels"),
    [
        ("thread_polyester_filament", 5.0, 146.0, 3),
        ("silk_crepe_de_chine", 5.0, 236.25, 2),
        ("polyester_satin_charmeuse_back", 10.0, 281.25, 3),
    ],
)
def test_level_far_is_the_mean_of_weave_under_a_low_sun(name, elevation, azimuth, channels):
    fabric = even(load(name))
    n = 40000
    uv = np.arange(n)[:, None] * [0.7548776662466927, 0.5698402909980532] % 1.0
    uv *= true_repeat(fabric)
    up, turn = np.radians(elevation), np.radians(azimuth)
    wi = np.array([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)])
    for wo in ([0.0, 0.0, 1.0], [-0.5, 0.3, 0.81], [0.54, 0.2, 0.82], [-0.31, 0.85, 0.42]):
        wo = np.array(wo) / np.linalg.norm(wo)
        near = evaluate(fabric, np.repeat(wi[None], n, axis=0), wo, uv, "weave", "horizon")
        far = evaluate(fabric, wi, wo, shadow="horizon")[0]
        mean = near.mean(axis=0)
        assert mean[:channels] == pytest.approx(far[:channels], rel=0.01)
        assert mean == pytest.approx(far, rel=0.025)

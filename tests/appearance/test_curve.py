"""The tangent curve: angle, height in closed form, quadrature."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad

from fabricusd.appearance import curve as c
from fabricusd.errors import FabricError
from fabricusd.fabric import DEGREE, TangentCurve
from tests.appearance.presets import PRESETS
from tests.strategies import curves


def degrees(angles: tuple[float, ...], lengths: tuple[float, ...]) -> TangentCurve:
    return TangentCurve.from_lengths([a * DEGREE for a in angles], lengths)


HUMP = degrees((-25, 25), (1,))
BACK = degrees((-30, -30, 30, 30, -5, -5, 5, 5), (1.33, 1.33, 1.33, 0, 0.67, 0.67, 0.67))
BENT = {
    "hump": HUMP,
    "crepe": degrees((-35, -35, 35, 35), (1, 1, 1)),
    "satin": degrees((-32, -32, -18, 0, 0, 18, 32, 32), (1.33, 0.66, 2, 2, 2, 0.66, 1.33)),
    "satin back, two humps and a jump": BACK,
    "valley": degrees((25, -25), (1,)),
    "almost straight pieces": degrees((-10, -10 + 1e-9, 10, 10), (1, 1, 1)),
    "steep, at 85 degrees": degrees((-85, 85), (1,)),
}


@pytest.mark.parametrize("curve", BENT.values(), ids=BENT.keys())
def test_height_is_minus_the_integral_of_the_tangent(curve: TangentCurve) -> None:
    jumps = list(np.unique(c.pieces(curve).start))
    for s in (0.0, 0.03, 0.31, 0.5, 0.77, 1.0):
        points = [x for x in jumps if 0 < x < s] or None
        numeric = -quad(lambda x: math.tan(c.angle_at(curve, x)), 0, s, points=points)[0]
        assert c.height_at(curve, s) == pytest.approx(numeric, abs=1e-9)


@pytest.mark.parametrize("curve", BENT.values(), ids=BENT.keys())
def test_height_is_zero_where_the_visible_run_ends(curve: TangentCurve) -> None:
    assert c.height_at(curve, 0.0) == 0.0
    assert abs(c.height_at(curve, 1.0)) < 1e-8


def test_a_hump_rises_above_the_threads_it_crosses() -> None:
    assert c.height_at(HUMP, 0.5) == pytest.approx(-math.log(math.cos(25 * DEGREE)) / (50 * DEGREE))
    assert c.peak(HUMP) == pytest.approx(c.height_at(HUMP, 0.5))
    assert c.height_at(BENT["valley"], 0.5) < 0
    assert c.peak(BENT["valley"]) == 0


def test_the_curve_is_right_continuous_at_a_jump() -> None:
    jump = BACK.positions[4] / BACK.positions[-1]
    assert c.angle_at(BACK, jump) == pytest.approx(-5 * DEGREE)
    assert c.angle_at(BACK, jump - 1e-9) == pytest.approx(30 * DEGREE)
    velvet = degrees((-90, -55, 55, 90), (0.5, 0, 0.5))
    assert c.angle_at(velvet, 0.5) == pytest.approx(55 * DEGREE)


ZERO_LENGTHS = {
    "a jump inside": (degrees((-30, 30, -5, 5), (1, 0, 1)), 2),
    "at the start": (degrees((80, -20, 20), (0, 1)), 1),
    "at the end": (degrees((-20, 20, -80), (1, 0)), 1),
    "three points at one place": (degrees((-20, 0, 70, 0, 20), (1, 0, 0, 1)), 2),
}


@pytest.mark.parametrize(("curve", "count"), ZERO_LENGTHS.values(), ids=ZERO_LENGTHS.keys())
def test_a_zero_length_has_no_weight_and_no_node(curve: TangentCurve, count: int) -> None:
    assert len(c.pieces(curve).start) == count
    q = c.nodes(curve, math.pi)
    assert len(q.angle) == count
    assert q.weight.sum() == pytest.approx(1.0, abs=1e-15)
    assert np.isfinite(q.angle).all()


PILE = {
    "velvet 1": (degrees((-90, -50), (1,)), True),
    "velvet 2": (degrees((-90, -55, 55, 90), (0.5, 0, 0.5)), True),
    "above 85 degrees": (degrees((-85.1, 85.1), (1,)), True),
    "climbs and stays up": (degrees((-20, 10), (1,)), True),
    "leans forward all the way": (degrees((40, 40), (1,)), True),
    "at 85 degrees": (degrees((-85, 85), (1,)), False),
    "straight": (degrees((0, 0), (1,)), False),
    "closes as well as two decimals can": (degrees((-30, -30, 30, 30), (0.33, 0.34, 0.33)), False),
}


@pytest.mark.parametrize(("curve", "expected"), PILE.values(), ids=PILE.keys())
def test_pile_is_what_is_steep_or_does_not_close(curve: TangentCurve, expected: bool) -> None:
    assert c.is_pile(curve) is expected
    s = np.linspace(0, 1, 11)
    if expected:
        assert not c.height_at(curve, s).any()
    assert np.isfinite(c.height_at(curve, s)).all()


@given(curves())
def test_every_curve_has_finite_angles_and_heights_and_whole_weights(curve: TangentCurve) -> None:
    s = np.linspace(0, 1, 33)
    assert np.isfinite(c.angle_at(curve, s)).all()
    assert np.isfinite(c.height_at(curve, s)).all()
    q = c.nodes(curve, 0.1)
    assert q.weight.sum() == pytest.approx(1.0, abs=1e-12)
    assert (q.weight > 0).all()
    np.testing.assert_allclose(c.angle_at(curve, q.position), q.angle, atol=1e-9)
    p = c.pieces(curve)
    exact_mean = float((0.5 * (p.first + p.last)) @ p.length)
    assert float(q.angle @ q.weight) == pytest.approx(exact_mean, abs=1e-12)


@given(curves(), st.floats(0.02, 1.5))
def test_nodes_are_at_most_the_spacing_apart_on_a_piece(
    curve: TangentCurve, spacing: float
) -> None:
    p = c.pieces(curve)
    q = c.nodes(curve, spacing)
    for first, last, start, length in zip(p.first, p.last, p.start, p.length, strict=True):
        inside = (q.position > start) & (q.position < start + length)
        steps = abs(last - first) / np.count_nonzero(inside)
        assert steps <= spacing * (1 + 1e-6)


@given(curves(), st.sampled_from((1e-2, 1e-3, 1e-4)), st.floats(0.05, 1.0))
def test_nodes_meet_the_error_that_the_caller_asks_for(
    curve: TangentCurve, error: float, spacing: float
) -> None:
    q = c.nodes(curve, spacing, error=error)
    # The lobe of unit height, integrated by brute force over the curve.
    s = (np.arange(20000) + 0.5) / 20000
    for centre in (0.0, 0.3, -0.7, curve.angles[0]):
        lobe = np.exp(-0.5 * ((c.angle_at(curve, s) - centre) / spacing) ** 2).mean()
        found = float(np.exp(-0.5 * ((q.angle - centre) / spacing) ** 2) @ q.weight)
        assert abs(found - lobe) <= error + 2e-4


def test_the_error_measure_sees_nodes_that_are_too_few() -> None:
    assert c.lobe_error(HUMP, c.nodes(HUMP, 50 * DEGREE), 5 * DEGREE) > 0.5


PUBLISHED = [
    (name, k, t) for name, fabric in PRESETS.items() for k, t in enumerate(fabric.thread_list)
]


@pytest.mark.parametrize(
    ("name", "k", "thread"), PUBLISHED, ids=[f"{n} {k}" for n, k, _ in PUBLISHED]
)
def test_nodes_a_lobe_apart_are_within_about_one_percent_at_every_centre(name, k, thread) -> None:  # type: ignore[no-untyped-def]
    width = thread.gamma_surface
    worst = c.lobe_error(thread.curve, c.nodes(thread.curve, width), width)
    assert worst < 0.011
    # Half of the spacing divides the error by about four: the rule is of second order.
    finer = c.lobe_error(thread.curve, c.nodes(thread.curve, width / 2), width)
    assert finer < 0.31 * worst + 1e-9


def test_the_crest_is_where_the_height_is_greatest() -> None:
    np.testing.assert_allclose(c.crest(HUMP), [[0.5, 0.5]])
    satin = BENT["satin"]
    level = np.array([3.99, 5.99]) / 9.98
    assert any(np.allclose(stretch, level) for stretch in c.crest(satin))
    assert [0.0, 1.0] in c.crest(TangentCurve()).tolist()
    for curve in BENT.values():
        s = np.linspace(0, 1, 4001)
        assert c.height_at(curve, s).max() <= c.peak(curve) + 1e-12
        assert c.height_at(curve, s).max() == pytest.approx(c.peak(curve), abs=1e-3)


@given(curves())
def test_a_curve_shorn_of_its_lengths_is_the_same_curve(curve: TangentCurve) -> None:
    assume(len(curve.positions) < 6)
    double = TangentCurve(positions=tuple(3 + 7 * x for x in curve.positions), angles=curve.angles)
    s = np.linspace(0.01, 0.99, 7)
    np.testing.assert_allclose(c.height_at(double, s), c.height_at(curve, s), atol=1e-9)


@pytest.mark.parametrize("spacing", [0.0, -1.0, math.nan])
def test_a_spacing_of_nothing_is_refused(spacing: float) -> None:
    with pytest.raises(FabricError, match=r"spacing is .*; it must be above 0"):
        c.nodes(HUMP, spacing)
    with pytest.raises(FabricError, match=r"error is .*; it must be above 0"):
        c.nodes(HUMP, 0.1, error=spacing)

"""The tangent curve: angle, height in closed form, crest, pile."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from scipy.integrate import quad

from fabricusd.appearance.weave import curve as c
from fabricusd.fabric import DEGREE, TangentCurve
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
def test_a_zero_length_is_no_piece_and_has_no_weight(curve: TangentCurve, count: int) -> None:
    assert len(c.pieces(curve).start) == count
    assert c.pieces(curve).length.sum() == pytest.approx(1.0, abs=1e-15)
    assert (c.pieces(curve).length > 0).all()


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
    p = c.pieces(curve)
    assert p.length.sum() == pytest.approx(1.0, abs=1e-12)
    middle = p.start + 0.5 * p.length
    np.testing.assert_allclose(c.angle_at(curve, middle), 0.5 * (p.first + p.last), atol=1e-9)


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

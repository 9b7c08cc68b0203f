"""Between the views: exact at them, right on narrow cones, and eq. 3.8 for comparison."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.appearance.thread import evaluate
from fabricusd.errors import FabricError
from fabricusd.measure.angles import DEGREE, direction
from fabricusd.measure.interpolate import interpolated
from tests.measure.shoots import FILAMENT, SPUN, lobes_of

INCIDENCE = 32 * DEGREE


def at(lobes):
    here = lobes.of(np.abs(lobes.theta_i - INCIDENCE) < 1e-6)
    return here.theta_o, here.phi_d, here.f


@pytest.mark.parametrize("method", ["ratio", "bilinear"])
def test_at_the_views_the_lobes_come_back(method):
    lobes = lobes_of(SPUN, "half")
    theta_o, phi_d, f = at(lobes)
    found = interpolated(lobes, INCIDENCE, theta_o, phi_d, method=method, thread=SPUN)
    np.testing.assert_allclose(found, f, rtol=1e-5, atol=1e-9)


def on_the_cone(method: str) -> float:
    """Mean relative error between views on the mirror cone of a filament."""
    lobes = lobes_of(FILAMENT, "half", noise=0.0)
    phi = np.linspace(3, 165, 300) * DEGREE
    theta = np.full_like(phi, -INCIDENCE)
    found = interpolated(lobes, INCIDENCE, theta, phi, method=method, thread=FILAMENT)
    wi = np.broadcast_to(direction(INCIDENCE, 0.0), (300, 3))
    true = evaluate(FILAMENT, wi, direction(theta, phi), "microcylinder")
    return float((found / true - 1).mean())


def test_the_ratio_to_the_thread_is_exact_for_its_own_lobes_and_eq_3_8_is_too_low():
    assert abs(on_the_cone("ratio")) < 1e-6
    assert on_the_cone("thesis") < -0.05
    assert abs(on_the_cone("bilinear")) < abs(on_the_cone("thesis"))


def test_azimuths_beyond_half_a_turn_are_mirrored():
    lobes = lobes_of(SPUN, "half")
    theta = np.array([-0.3, 0.2])
    one = interpolated(lobes, INCIDENCE, theta, np.array([0.4, 2.0]), method="bilinear")
    two = interpolated(lobes, INCIDENCE, theta, np.array([-0.4, 2 * np.pi - 2.0]),
                       method="bilinear")  # fmt: skip
    np.testing.assert_allclose(one, two)


def test_what_was_not_measured_is_refused():
    lobes = lobes_of(SPUN)
    here = (np.zeros(1), np.zeros(1))
    with pytest.raises(FabricError, match="is 20 degrees; it must be one of 0, 15, 30, 45, 60"):
        interpolated(lobes, 20 * DEGREE, *here, method="bilinear")
    with pytest.raises(FabricError, match="thread is missing"):
        interpolated(lobes, 0.0, *here)
    with pytest.raises(FabricError, match="is 'cubic'; it must be one of ratio"):
        interpolated(lobes, 0.0, *here, method="cubic")

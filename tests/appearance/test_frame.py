"""The direction convention: frames, angles and their undefined places."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.appearance import frame

R = np.float64
angles = st.floats(-math.pi / 2, math.pi / 2)
azimuths = st.floats(-math.pi, math.pi)


def _axes(thread_set, psi0):
    """t, b, n_t in the surface frame, from the sentence in MODEL section 1."""
    a = np.array([0.0, 1.0, 0.0] if thread_set == frame.WARP else [1.0, 0.0, 0.0])
    n = np.array([0.0, 0.0, 1.0])
    t = math.cos(psi0) * a - math.sin(psi0) * n
    n_t = math.sin(psi0) * a + math.cos(psi0) * n
    return t, np.cross(n_t, t), n_t


def _unit(theta, phi):
    return np.array(
        [math.sin(theta), math.cos(theta) * math.sin(phi), math.cos(theta) * math.cos(phi)]
    )


@settings(deadline=None)
@given(st.sampled_from([frame.WARP, frame.WEFT]), angles, angles, azimuths)
def test_the_thread_frame_is_the_one_of_the_definition(thread_set, psi0, theta, phi):
    w = _unit(theta, phi)
    got = frame.to_thread(R, thread_set, math.cos(psi0), math.sin(psi0), *w)
    np.testing.assert_allclose(got, [w @ axis for axis in _axes(thread_set, psi0)], atol=1e-15)
    back = frame.from_thread(R, thread_set, math.cos(psi0), math.sin(psi0), *got)
    np.testing.assert_allclose(back, w, atol=1e-15)


@pytest.mark.parametrize("thread_set", [frame.WARP, frame.WEFT])
def test_the_thread_frame_is_right_handed(thread_set):
    t, b, n = _axes(thread_set, 0.3)
    np.testing.assert_allclose(np.cross(t, b), n, atol=1e-15)


def test_a_positive_angle_leans_the_normal_forward():
    _, _, n = _axes(frame.WEFT, math.radians(25))
    assert n[0] > 0


@settings(deadline=None)
@given(angles, angles)
def test_half_inclination_is_the_mean_angle_and_the_cosine_of_half_the_difference(a, b):
    numbers = math.sin(a), math.cos(a), math.sin(b), math.cos(b)
    assert frame.half_inclination(R, *numbers) == pytest.approx((a + b) / 2, abs=1e-15)
    assert frame.cos2_half_inclination(R, *numbers) == pytest.approx(
        math.cos((a + b) / 2) ** 2, rel=1e-9, abs=1e-15
    )
    assert frame.cos2_difference_inclination(R, *numbers) == pytest.approx(
        math.cos((a - b) / 2) ** 2, rel=1e-9, abs=1e-15
    )


def test_half_inclination_does_not_cancel_at_grazing_angles_in_float32():
    a, b = math.radians(89.9), math.radians(-89.8)
    numbers = [np.float32(f(x)) for x in (a, b) for f in (math.sin, math.cos)]
    single = np.float32
    assert frame.half_inclination(single, *numbers) == pytest.approx((a + b) / 2, rel=1e-5)
    assert frame.cos2_difference_inclination(single, *numbers) == pytest.approx(
        math.cos((a - b) / 2) ** 2, rel=1e-5
    )


def test_opposite_directions_along_the_thread_are_on_each_others_mirror_cone():
    assert frame.half_inclination(R, 1.0, 0.0, -1.0, 0.0) == 0
    assert frame.cos2_difference_inclination(R, 1.0, 0.0, -1.0, 0.0) == 0


@settings(deadline=None)
@given(azimuths, azimuths)
def test_half_differences_are_those_of_the_wrapped_angle(p, q):
    d = math.remainder(p - q, 2 * math.pi)
    numbers = math.sin(p), math.cos(p), math.sin(q), math.cos(q)
    assert frame.half_difference(R, *numbers) == pytest.approx(abs(d) / 2, abs=1e-12)
    assert frame.cos_half_difference(R, *numbers) == pytest.approx(math.cos(d / 2), abs=1e-12)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_a_direction_along_the_thread_has_azimuth_zero(precision):
    zero = precision(0)
    c = frame.cos_inclination(precision, zero, zero)
    assert c == 0
    assert frame.unit_azimuth(precision, zero, zero, c) == (0, 1)

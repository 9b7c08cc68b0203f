"""Fresnel, the unit-area Gaussian and the longitudinal kernel K: identities and limits."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.appearance.scattering import lobes

R = np.float64
WIDTHS = {
    "0.06 degrees": 0.001,
    "2.5 degrees": 0.0436,
    "24 degrees": 0.42,
    "60 degrees": 1.05,
    "180 degrees": math.pi,
}


def _sin_cos(angle):
    return math.sin(angle), math.cos(angle)


def _fresnel_by_snell(eta, c):
    """The textbook form with the refraction angle."""
    ct = math.sqrt(1 - (1 - c * c) / eta**2)
    rs, rp = (c - eta * ct) / (c + eta * ct), (eta * c - ct) / (eta * c + ct)
    return (rs * rs + rp * rp) / 2


@settings(deadline=None)
@given(st.floats(1.0, 10.0), st.floats(1e-3, 1.0))
def test_fresnel_is_snells_and_loses_nothing(eta, c):
    reflected, transmitted = lobes.fresnel(R, eta * eta - 1, c)
    assert reflected == pytest.approx(_fresnel_by_snell(eta, c), abs=1e-12)
    assert reflected + transmitted == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize("c", [0.0, 1e-20, 1e-6, 0.3, 1.0])
def test_an_index_of_one_reflects_nothing(precision, c):
    assert lobes.fresnel(precision, precision(0), precision(c)) == (0.0, pytest.approx(1.0))


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_fresnel_reaches_total_reflection_at_grazing_and_at_a_large_index(precision):
    assert lobes.fresnel(precision, precision(1.25), precision(0))[0] == pytest.approx(1, abs=1e-6)
    big = precision(lobes.LARGEST_IOR**2)
    reflected, transmitted = lobes.fresnel(precision, big, precision(0.7))
    assert reflected == pytest.approx(1, abs=1e-6)
    assert 0 < transmitted < 1e-6


@pytest.mark.parametrize("name", WIDTHS)
def test_the_gaussian_has_unit_area(name):
    s = WIDTHS[name]
    x = np.linspace(-12 * s, 12 * s, 20_001)
    y = [lobes.gaussian(R, *lobes.gaussian_constants(s), v) for v in x]
    assert np.sum(y) * (x[1] - x[0]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("name", WIDTHS)
@pytest.mark.parametrize("a", [0.0, 0.5, -1.2, 1.5, math.pi / 2])
def test_the_longitudinal_kernel_integrates_to_one(name, a):
    s = WIDTHS[name]
    constants = lobes.longitudinal_constants(s)
    # Gauss-Legendre pieces, dense around the maximum near -a.
    edges = np.unique(np.clip(-a + s * np.arange(-12.0, 13.0), -math.pi / 2, math.pi / 2))
    edges = np.unique(np.concatenate(([-math.pi / 2, math.pi / 2], edges)))
    x, w = np.polynomial.legendre.leggauss(40)
    total = 0.0
    for low, high in itertools.pairwise(edges):
        for node, weight in zip(x, w, strict=True):
            b = (low + high) / 2 + (high - low) / 2 * node
            k = lobes.longitudinal(R, *constants, *_sin_cos(a), *_sin_cos(b))
            total += weight * (high - low) / 2 * k * math.cos(b)
    assert total == pytest.approx(1.0, abs=1e-12)


@settings(deadline=None)
@given(st.floats(-1.57, 1.57), st.floats(-1.57, 1.57), st.sampled_from(sorted(WIDTHS)))
def test_the_longitudinal_kernel_is_symmetric_and_not_negative(a, b, name):
    c = lobes.longitudinal_constants(WIDTHS[name])
    p, q = _sin_cos(a), _sin_cos(b)
    forward = lobes.longitudinal(R, *c, *p, *q)
    assert forward >= 0
    assert lobes.longitudinal(R, *c, *q, *p) == pytest.approx(forward, rel=1e-12, abs=1e-300)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize("s", [0.0, 1e-12, 1e-3, 1.0, 100.0])
@pytest.mark.parametrize("theta", [0.0, 0.7, math.pi / 2])
def test_lobes_stay_finite_at_every_width(precision, s, theta):
    sin, cos = precision(math.sin(theta)), precision(max(0.0, math.cos(theta)))
    constants = [precision(x) for x in lobes.longitudinal_constants(s)]
    k = lobes.longitudinal(precision, *constants, sin, cos, -sin, cos)
    g = lobes.gaussian(
        precision, *(precision(x) for x in lobes.gaussian_constants(s)), precision(0)
    )
    assert np.isfinite(k)
    assert np.isfinite(g)
    assert k > 0
    assert g > 0

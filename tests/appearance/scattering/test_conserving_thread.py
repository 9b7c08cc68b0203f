"""A `conserving` thread gives back what it does not absorb, at every inclination."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from fabricusd.appearance.scattering.models import conserving
from fabricusd.appearance.thread import evaluate
from fabricusd.fabric import Thread
from fabricusd.schema import load
from tests.appearance.presets import PRESETS

WHITE = Thread(albedo=(1.0, 1.0, 1.0))
INCLINATIONS = np.radians([0, 10, 30, 45, 60, 75, 85, 89])

THREADS = {
    "linen": (12, 24, 1.46, 1, 0.3),
    "satin filament": (2.5, 5, 1.539, 1, 0.1),
    "wide lobes": (30, 60, 1.539, 1, 0.7),
    "narrow, bright surface": (0.5, 1, 1.5, 8, 0.0),
    "narrow surface over a wide volume": (1, 60, 2.5, 8, 0.0),
    "no surface": (5, 10, 1.0, 1, 0.2),
    "isotropic": (12, 24, 1.46, 1, 1.0),
}


def _thread(gs, gv, ior, gain, isotropic, albedo=1.0):
    return replace(
        WHITE, albedo=(albedo,) * 3, ior=ior, isotropic=isotropic, surface_gain=gain,
        gamma_surface=math.radians(gs), gamma_volume=math.radians(gv),
    )  # fmt: skip


def _directional_albedo(thread, theta):
    """Integral of f_s cos(theta_o) dwo by Gauss points in pieces that follow both lobes."""
    x, weight = np.polynomial.legendre.leggauss(64)
    reach = [s * n for s in (thread.gamma_surface, thread.gamma_volume) for n in (-18, -4, 4, 18)]
    inside = [-theta + r for r in reach if abs(-theta + r) < math.pi / 2]
    cuts = sorted({-math.pi / 2, math.pi / 2, -theta, theta, 0.0, *inside})
    phi = (x + 1) * math.pi / 2
    viewer = np.array([math.sin(theta), 0.0, math.cos(theta)])
    total = 0.0
    for low, high in pairwise(cuts):
        out, around = np.meshgrid(low + (high - low) * (x + 1) / 2, phi, indexing="ij")
        wi = np.stack(
            [np.sin(out), np.cos(out) * np.sin(around), np.cos(out) * np.cos(around)], axis=-1
        )
        f = evaluate(thread, wi.reshape(-1, 3), viewer, "conserving")[:, 0].reshape(out.shape)
        total += (weight * (high - low) / 2) @ (f * np.cos(out) ** 2) @ weight * math.pi
    return float(total)


@pytest.mark.parametrize("name", THREADS)
def test_a_white_thread_gives_all_light_back(name):
    thread = _thread(*THREADS[name])
    found = [_directional_albedo(thread, theta) for theta in INCLINATIONS]
    np.testing.assert_allclose(found, 1.0, atol=1e-3)


@pytest.mark.parametrize("preset", PRESETS)
def test_white_threads_of_the_presets_give_all_light_back(preset):
    for thread in load(preset).thread_list:
        white = replace(thread, albedo=(1.0, 1.0, 1.0))
        found = [_directional_albedo(white, theta) for theta in INCLINATIONS[::3]]
        np.testing.assert_allclose(found, 1.0, atol=1e-3)


def test_a_grey_thread_gives_back_its_surface_and_its_albedo_of_the_rest():
    thread = _thread(*THREADS["linen"], albedo=0.4)
    surface = _thread(*THREADS["linen"], albedo=0.0)
    for theta in INCLINATIONS:
        e = _directional_albedo(surface, theta)
        assert _directional_albedo(thread, theta) == pytest.approx(e + 0.4 * (1 - e), abs=1e-3)


def test_without_the_last_term_a_white_thread_loses_a_tenth(monkeypatch):
    nothing = np.zeros(conserving.TRANSMISSION_ENTRIES)
    monkeypatch.setattr(conserving, "lost_energy", lambda *_: (nothing, 0.0))
    assert 0.85 < _directional_albedo(_thread(*THREADS["linen"]), 0.0) < 0.93


def test_a_surface_that_reflects_everything_leaves_nothing_to_complete():
    lost, norm = conserving.lost_energy(math.radians(12), 1e6, 1e6, math.radians(24), 0.3)
    assert np.isfinite(lost).all()
    assert norm >= 0


def test_the_integral_of_the_table_is_that_of_what_it_interpolates():
    root = np.linspace(0, 1, conserving.TRANSMISSION_ENTRIES)
    # f = sqrt(cos theta) is linear in the table's variable, so interpolation is exact.
    exact = math.sqrt(math.pi) * math.gamma(1.75) / math.gamma(2.25)
    assert conserving.cosine_square_integral(root) == pytest.approx(exact, rel=1e-10)
    assert conserving.cosine_square_integral(np.ones_like(root)) == pytest.approx(math.pi / 2)

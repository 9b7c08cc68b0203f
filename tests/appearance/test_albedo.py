"""The share of light that a fabric sends back, against plain integration and published bounds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance import plain
from fabricusd.appearance.albedo import (
    FINE,
    QUICK,
    albedo_by_view,
    directional_albedo,
    groups,
    safe_albedo,
)
from fabricusd.fabric import ThreadSet
from fabricusd.geometry.nearest import published

# MODEL section 2: white threads, worst view.
SAFE = {
    "linen_plain": 1.01,
    "velvet": 0.58,
    "silk_crepe_de_chine": 0.37,
    "polyester_satin_charmeuse_back": 0.36,
    "silk_shot": 0.34,
    "polyester_satin_charmeuse": 0.28,
}


@pytest.mark.parametrize("name", SAFE)
def test_the_largest_safe_albedo_is_the_published_one(name):
    # The two disagree by up to 7 %: a grid of views may step over the worst one.
    assert safe_albedo(published(name), QUICK) == pytest.approx(SAFE[name], rel=0.08)


@pytest.mark.parametrize("name", ["linen_plain", "wool_flannel"])
@pytest.mark.parametrize("theta", [0.3, 1.2])
def test_it_is_what_plain_integration_over_the_sky_gives(name, theta):
    fabric = published(name)
    found = albedo_by_view(fabric, [theta], FINE)[0, 0]
    cosine = (np.arange(160) + 0.5) / 160
    around = (np.arange(320) + 0.5) / 320 * 2 * math.pi
    z, phi = (x.ravel() for x in np.meshgrid(cosine, around, indexing="ij"))
    r = np.sqrt(1 - z * z)
    wi = np.stack((r * np.cos(phi), r * np.sin(phi), z), axis=-1)
    wo = np.broadcast_to([math.sin(theta), 0.0, math.cos(theta)], wi.shape)
    expected = plain.far(fabric, wi, wo, per_segment=24).mean(axis=0) * 2 * math.pi
    assert found == pytest.approx(expected, rel=0.01)


def test_at_the_safe_albedo_the_worst_view_sends_back_everything():
    fabric = published("silk_crepe_de_chine")
    surface, volume = directional_albedo(fabric, np.radians([0, 40, 70, 80, 85, 88, 89.5]), QUICK)
    total = surface.sum(axis=2) + safe_albedo(fabric, QUICK) * volume.sum(axis=2)
    assert total.max() == pytest.approx(1.0, rel=1e-9)


def test_threads_that_differ_in_color_alone_are_one_group():
    fabric = published("linen_plain")
    one = fabric.threads["Linen"]
    threads = {f"C{k}": replace(one, albedo=(0.1 * k, 0, 0)) for k in range(1, 5)}
    striped = replace(fabric, threads=threads, warp=ThreadSet(sequence=(0, 1, 2, 3), density=1500))
    assert len(groups(striped)) == 2
    means = [color[0] for share, color in groups(striped) if share.is_warp]
    assert means == [pytest.approx(0.25)]


def test_a_fabric_without_inner_scattering_is_safe_at_any_albedo():
    fabric = replace(published("linen_plain"), model="conserving")
    assert safe_albedo(fabric, QUICK) == math.inf

"""Shares by direction: those that a fabric states; where it states none, the presets' medians."""

from dataclasses import fields, replace

import numpy as np
import pytest

from fabricusd.appearance.conserving.by_side import CLOSING, MEDIAN, by_side
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.schema import load, published_names
from fabricusd.sides import AZIMUTHS, POLAR, Sides, spread
from tests.appearance.presets import PRESETS

LINEN = PRESETS["linen_plain"]
PHI, THETA = (x.ravel() for x in np.meshgrid(np.radians(AZIMUTHS), np.radians(POLAR)))


def _stated():
    found = {name: load(name) for name in published_names()}
    return {name: fabric for name, fabric in found.items() if fabric.sides.forward}


def test_the_medians_are_those_of_the_presets():
    stated = _stated()
    assert len(stated) == 13
    for name in ("surface", "reflected", "transmitted", "forward"):
        every = np.array([spread(getattr(f.sides, name)) for f in stated.values()])
        np.testing.assert_allclose(
            getattr(MEDIAN, name), np.median(every, axis=(0, 2)), atol=6e-4, err_msg=name
        )
    open_cloth = [f for f in stated.values() if coverage(f).gap > 0.02]
    closing = np.array([spread(f.sides.gap) / coverage(f).gap for f in open_cloth])
    np.testing.assert_allclose(CLOSING, np.median(closing, axis=(0, 2)), atol=6e-3)


@pytest.mark.parametrize("count", [1, len(POLAR), len(POLAR) * len(AZIMUTHS)])
def test_shares_are_those_stated_at_the_directions_that_state_them(count):
    rng = np.random.default_rng(4)
    stated = Sides(**{f.name: tuple(rng.uniform(0, 0.5, count)) for f in fields(Sides)})
    # Straight down there is one direction.
    found = by_side(replace(LINEN, sides=stated), THETA, PHI)
    for f in fields(Sides):
        want = spread(getattr(stated, f.name)).ravel()
        np.testing.assert_allclose(getattr(found, f.name), want, atol=1e-9, err_msg=f.name)
    # Between and beyond them, they stay shares.
    theta, phi = rng.uniform(0, 0.5 * np.pi, 500), rng.uniform(-np.pi, np.pi, 500)
    for shares in by_side(replace(LINEN, sides=stated), theta, phi):
        assert np.all((shares >= 0) & (shares <= 1))


def test_shares_are_the_same_at_mirrored_azimuths():
    theta, phi = np.full(4, 0.9), np.array([0.3, -0.3, np.pi - 0.3, np.pi + 0.3])
    for shares in by_side(load("polyester_satin_charmeuse"), theta, phi):
        np.testing.assert_allclose(shares, shares[0], atol=1e-12)


def test_one_stated_share_leaves_the_others_at_their_medians():
    found = by_side(replace(LINEN, sides=Sides(reflected=(0.95,))), THETA, PHI)
    np.testing.assert_allclose(found.forward, spread(MEDIAN.forward).ravel(), atol=1e-9)
    # More cannot leave at once than was scattered.
    np.testing.assert_allclose(found.reflected + found.transmitted, 1.0, atol=0.05)
    assert np.all(found.reflected + found.transmitted <= 1.0 + 1e-12)


def test_an_unstated_gap_closes_from_what_it_is_from_above():
    found = by_side(LINEN, THETA, PHI).gap.reshape(len(POLAR), -1)
    np.testing.assert_allclose(found[0], coverage(LINEN).gap, atol=1e-9)
    assert np.all(np.diff(found, axis=0) <= 1e-12)
    assert np.all(found[-1] == 0)


def test_what_opaque_cloth_swallows_is_the_same_from_everywhere():
    found = by_side(replace(LINEN, opaque=True), THETA, PHI)
    np.testing.assert_allclose(found.gap, coverage(LINEN).gap)

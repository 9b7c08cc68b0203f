"""Sums per colour without demosaicing, background, and the diameter of a thread in focus."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.measure.capture.frames import Frame
from fabricusd.measure.capture.reflectance import (
    SITES,
    channel_means,
    imaged_diameter,
    thread_sum,
)
from fabricusd.measure.gantry.camera import mosaicked
from fabricusd.measure.gantry.scenes import thread_radiance

FRAME = Frame(shape=(48, 96), top=0, bottom=48, left=16, right=80)


@pytest.mark.parametrize("pattern", SITES)
def test_each_pattern_gives_its_colours_back(pattern):
    area = np.empty((8, 8))
    for site, channel in enumerate(SITES[pattern]):
        area[site // 2 :: 2, site % 2 :: 2] = (0.1, 0.2, 0.4)[channel]
    np.testing.assert_allclose(channel_means(area, pattern), [0.1, 0.2, 0.4])


def test_a_grey_sensor_has_one_value_for_all_colours():
    area = np.random.default_rng(0).random((8, 8))
    np.testing.assert_allclose(channel_means(area, "grey"), np.full(3, area.mean()))


def test_a_thread_brighter_at_one_end_has_the_same_red_as_blue():
    ramp = np.linspace(1.0, 2.0, 48)[:, None] * np.ones((1, 64))
    red, green, blue = channel_means(ramp, "RGGB")
    assert red == pytest.approx(blue, rel=1e-12)
    assert red == pytest.approx(green, rel=1e-12)


def test_the_sum_of_a_thread_ignores_an_even_background():
    value = np.array([0.2, 0.5, 1.0])
    colour = thread_radiance(value, FRAME.shape, 5.0, 3.0, 0.3, np.random.default_rng(0))
    for background in (0.0, 0.05):
        found = thread_sum(mosaicked(colour) + background, FRAME, "RGGB", "sides")
        np.testing.assert_allclose(found, value * 48 * 5.0, rtol=3e-3)


def test_setting_the_background_to_zero_loses_the_dim_flanks():
    colour = thread_radiance(np.full(3, 0.02), FRAME.shape, 5.0, 3.0, 0.3,
                             np.random.default_rng(0))  # fmt: skip
    raw = mosaicked(colour) + np.random.default_rng(1).normal(0, 0.001, FRAME.shape)
    assert (thread_sum(raw, FRAME, "RGGB", "zero") < 0.96 * 0.02 * 48 * 5).all()
    np.testing.assert_allclose(thread_sum(raw, FRAME, "RGGB", "sides"), 0.02 * 48 * 5, rtol=0.08)


@pytest.mark.parametrize("diameter", [3.0, 5.0, 12.5])
def test_the_diameter_of_a_thread_in_focus_is_found(diameter):
    colour = thread_radiance(np.ones(3), FRAME.shape, diameter, 0.0, 0.3, np.random.default_rng(0))
    profile = colour[..., 1].mean(axis=0) + np.random.default_rng(1).normal(0, 2e-3, 96)
    beside = np.concatenate([profile[:16], profile[80:]])
    assert imaged_diameter(profile[16:80], beside) == pytest.approx(diameter, rel=0.03)


def test_no_thread_has_no_diameter():
    assert not imaged_diameter(np.zeros(64), np.ones(32)) > 0

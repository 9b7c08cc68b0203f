"""The response of a camera from exposures of a chart."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.measure.capture.response import linear_response, patch_means, spline_response
from fabricusd.measure.gantry.camera import Camera, mosaicked
from fabricusd.measure.gantry.scenes import chart_radiance

GREYS = np.geomspace(0.01, 0.3, 24)
TIMES = np.geomspace(0.01, 1.2, 12)


def exact(camera: Camera) -> np.ndarray:
    """The camera's own response, 0 at black and 1 at half the range."""
    exposure = np.linspace(0, 1.6, 40001)
    codes = camera.response(exposure) * camera.levels
    table = np.interp(np.arange(camera.levels + 1), codes, exposure) - camera.black
    return table / np.interp(0.5 * camera.levels, np.arange(camera.levels + 1), table)


def means(camera: Camera, rng) -> np.ndarray:
    chart = mosaicked(chart_radiance(GREYS, 4, 6, (48, 96)))
    return np.array([
        patch_means(np.mean([camera.expose(chart, t, rng) for _ in range(4)], axis=0), 4, 6)
        for t in TIMES
    ])  # fmt: skip


@pytest.mark.parametrize(("bits", "knee", "most"), [(12, 0.94, 0.004), (8, 0.94, 0.006),
                                                    (12, 0.7, 0.01)])  # fmt: skip
def test_the_response_is_found_within_a_fraction_of_a_percent(bits, knee, most):
    camera = Camera(bits=bits, knee=knee)
    black = camera.black * camera.levels
    found = spline_response(means(camera, np.random.default_rng(1)), TIMES, camera.levels, black)
    s = slice(int(0.08 * camera.levels), int(0.92 * camera.levels))
    off = found[s] / exact(camera)[s] - 1
    assert np.sqrt((off**2).mean()) < most
    assert found[round(black)] == pytest.approx(0, abs=3 / camera.levels)
    assert np.interp(0.5 * camera.levels, np.arange(camera.levels + 1), found) == pytest.approx(1)


def test_a_curved_response_is_not_found_to_be_linear():
    camera = Camera(bits=12, knee=0.7)
    found = linear_response(camera.levels, camera.black * camera.levels)
    s = slice(int(0.08 * camera.levels), int(0.92 * camera.levels))
    assert np.sqrt(((found[s] / exact(camera)[s] - 1) ** 2).mean()) > 0.03


def test_codes_below_black_stay_negative_so_that_noise_averages_out():
    camera = Camera(bits=12)
    black = camera.black * camera.levels
    found = spline_response(means(camera, None), TIMES, camera.levels, black)
    assert (np.diff(found[: int(black) + 2]) > 0).all()
    assert found[0] < 0


def test_a_chart_that_shows_next_to_nothing_is_refused():
    dark = np.full((3, 40), 100.0)
    with pytest.raises(FabricError, match="the chart has 0 means of patches that are neither"):
        spline_response(dark, np.array([0.1, 0.2, 0.4]), 4095, 120.0)


def test_patches_are_averaged_within_their_inner_half_per_site():
    chart = chart_radiance(np.arange(6.0), 2, 3, (24, 36))[..., 0]
    found = patch_means(chart, 2, 3).reshape(4, 6)
    np.testing.assert_array_equal(found, np.tile(np.arange(6.0), (4, 1)))

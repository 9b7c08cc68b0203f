"""Exposures merged: right where they are bright, dim, and saturated."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.measure.capture.merge import Sensor, merge
from fabricusd.measure.capture.response import linear_response
from fabricusd.measure.gantry.camera import Camera

CAMERA = Camera(bits=12, knee=1.0)
TIMES = (0.02, 0.08, 0.25, 0.8)
SHAPE = (32, 32)


def sensor(hdr: str = "counts") -> Sensor:
    black = CAMERA.black * CAMERA.levels
    table = linear_response(CAMERA.levels, black).astype(np.float32)
    per_second = CAMERA.dark / CAMERA.full * CAMERA.levels / (0.5 * CAMERA.levels - black)
    return Sensor(
        response=table, dark={t: np.full(4, per_second * t) for t in TIMES}, levels=CAMERA.levels,
        hdr=hdr,
    )  # fmt: skip


def frames(radiance: float, seed: int | None = 0, shots: int = 2):
    rng = None if seed is None else np.random.default_rng(seed)
    even = np.full(SHAPE, radiance)
    return {t: [CAMERA.expose(even, t, rng) for _ in range(shots)] for t in TIMES}


UNIT = CAMERA.gain / CAMERA.full * CAMERA.levels / (0.5 - CAMERA.black) / CAMERA.levels
"""Exposure per second of a radiance of 1."""


@pytest.mark.parametrize("radiance", [0.0005, 0.01, 0.3, 1.0, 5.0, 14.0])
def test_the_mean_of_merged_sites_is_the_radiance(radiance):
    merged = merge(frames(radiance), sensor())
    assert merged.lost == 0
    assert merged.radiance.mean() == pytest.approx(radiance * UNIT, rel=0.01, abs=2e-4 * UNIT)


def test_noise_of_the_dark_averages_to_zero():
    merged = merge(frames(0.0), sensor())
    error = merged.radiance.std() / np.sqrt(merged.radiance.size)
    assert abs(merged.radiance.mean()) < 4 * error


def test_a_site_that_is_saturated_in_every_exposure_is_counted():
    merged = merge(frames(40.0), sensor())
    assert merged.lost == SHAPE[0] * SHAPE[1]


def test_sites_around_a_saturated_one_keep_their_shorter_exposures_only():
    even = np.full(SHAPE, 0.05)
    even[16, 16] = 8.0
    stack = {t: [CAMERA.expose(even, t, None)] for t in TIMES}
    stack[0.8][0][16, 17] += 500
    merged = merge(stack, sensor())
    assert merged.radiance[16, 17] == pytest.approx(0.05 * UNIT, rel=0.05)


def test_eq_3_3_as_printed_loses_dim_light_and_agrees_on_bright_light():
    dim, bright = 0.003, 1.0
    assert merge(frames(dim), sensor("thesis")).radiance.mean() < 0.5 * dim * UNIT
    found = merge(frames(bright), sensor("thesis")).radiance.mean()
    assert found == pytest.approx(bright * UNIT, rel=0.01)


def test_darkness_is_interpolated_between_exposures():
    found = sensor().dark_of(0.5)
    assert (sensor().dark_of(0.25) < found).all()
    assert (found < sensor().dark_of(0.8)).all()

"""Denoising: the mixture that keeps what the denoiser takes for noise."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.reference.denoise import mixed

SIDE = 96
SIGMA = 0.05


def pictures(stripes: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(truth, noisy, smooth): stripes of one pixel that the smooth picture has lost."""
    rng = np.random.default_rng(2)
    truth = np.full((SIDE, SIDE, 3), 0.5)
    truth[::2] += stripes
    truth[1::2] -= stripes
    noisy = truth + rng.normal(0.0, SIGMA, truth.shape)
    return truth, noisy.astype(np.float32), np.full((SIDE, SIDE, 3), 0.5, np.float32)


def error(picture: np.ndarray, truth: np.ndarray) -> float:
    return float(np.mean((picture - truth) ** 2))


def variance(share: float = 1.0) -> np.ndarray:
    return np.full((SIDE, SIDE, 3), share * SIGMA**2, np.float32)


@pytest.mark.parametrize("stripes", [0.0, 0.02, 0.05, 0.1, 0.4])
def test_the_mixture_is_about_as_good_as_the_better_of_both(stripes: float) -> None:
    truth, noisy, smooth = pictures(stripes)
    best = min(error(noisy, truth), error(smooth, truth))
    # Squares of 25 pixels know the bias to a fifth or so.
    assert error(mixed(noisy, smooth, variance()), truth) < 1.05 * best + 0.05 * SIGMA**2


def test_a_smooth_picture_without_bias_stays() -> None:
    truth, noisy, smooth = pictures(0.0)
    assert error(mixed(noisy, smooth, variance()), truth) < 0.1 * error(noisy, truth)


def test_stripes_that_were_smeared_come_back() -> None:
    truth, noisy, smooth = pictures(0.4)
    assert error(mixed(noisy, smooth, variance()), truth) < 0.02 * error(smooth, truth)


def test_the_denoised_picture_alone_would_have_lost_them() -> None:
    """The twin of the test before it: the bound bites."""
    truth, _, smooth = pictures(0.4)
    assert not error(smooth, truth) < 0.02 * error(smooth, truth)


def test_an_unknown_variance_leaves_the_smooth_picture() -> None:
    _, noisy, smooth = pictures(0.4)
    unknown = variance()
    unknown[10:20] = np.inf
    made = mixed(noisy, smooth, unknown)
    assert np.array_equal(made[10:20], smooth[10:20])
    assert np.isfinite(made).all()

"""What a picture says of its own variance, for samples whose mean varies by a known amount."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.reference.film import Film
from fabricusd.reference.rays.wave import BEAUTY_ROWS, DIRECT

WIDTH, HEIGHT, PASS = 64, 32, 16
PIXELS = np.arange(WIDTH * HEIGHT, dtype=np.int32)


def filled(samples, passes: int, width: int = WIDTH, height: int = HEIGHT) -> Film:
    """A film after `passes`; `samples(n)` are the n-th pass's values, (pixels, PASS)."""
    film = Film(width, height, ("beauty", "variance"))
    pixels = PIXELS[: width * height]
    for n in range(passes):
        rows = np.zeros((BEAUTY_ROWS, len(pixels) * PASS), np.float32)
        rows[DIRECT : DIRECT + 3] = samples(n)[: len(pixels)].ravel()
        film.add(pixels, PASS, rows)
        film.compare_halves()
    return film


def independent(n: int):
    return 1.0 + 0.5 * np.random.default_rng(n).standard_normal((len(PIXELS), PASS))


OF_A_SAMPLE = 1 / 12 / PASS**2 + 0.07**2
"""Variance of the mean of `stratified` samples times their number; of one alone it is 17 times."""


def stratified(n: int):
    """Sixteen strata, each met once a pass, and noise: the mean varies by that alone."""
    rng = np.random.default_rng(n)
    strata = rng.permuted(np.tile(np.arange(PASS), (len(PIXELS), 1)), axis=1)
    noise = 0.07 * rng.standard_normal(strata.shape)
    return 0.5 + (strata + rng.random(strata.shape)) / PASS + noise


@pytest.mark.parametrize("passes", [2, 3, 4, 6])
def test_of_independent_samples_the_variance_is_theirs_over_their_number(passes):
    variance = filled(independent, passes).variance()
    assert variance.mean() == pytest.approx(0.25 / (passes * PASS), rel=0.06)


@pytest.mark.parametrize("passes", [2, 3, 4, 6])
def test_of_samples_that_avoid_one_another_it_is_that_of_their_mean(passes):
    film = filled(stratified, passes)
    known = (film.beauty()[0] - 1.0).var()
    assert known == pytest.approx(OF_A_SAMPLE / (passes * PASS), rel=0.1)
    assert film.variance().mean() == pytest.approx(known, rel=0.15)
    # The twin: the groups alone say many times that.
    film._share[:] = 1.0
    assert film.variance().mean() > 10 * known


def test_a_square_is_judged_by_its_own_pixels():
    half = np.arange(len(PIXELS)) % WIDTH < WIDTH // 2

    def both(n: int):
        return np.where(half[:, None], independent(n), stratified(n))

    variance = filled(both, 4).variance()[0]
    assert variance[half].mean() == pytest.approx(0.25 / 64, rel=0.1)
    assert variance[~half].mean() == pytest.approx(OF_A_SAMPLE / 64, rel=0.15)


def test_few_pixels_are_judged_by_their_groups_alone():
    film = filled(stratified, 4, width=7, height=7)
    assert (film._share == 1.0).all()
    assert np.isfinite(film.variance()).all()


def test_pixels_that_stopped_early_leave_the_others_their_share():
    film = filled(stratified, 4)
    some = PIXELS[::5]
    rows = np.ones((BEAUTY_ROWS, len(some) * PASS), np.float32)
    film.add(some, PASS, rows)
    before = film._share.copy()
    film.compare_halves()
    np.testing.assert_array_equal(film._share, before)
    assert np.isfinite(film.variance()).all()


@pytest.mark.filterwarnings("error")
def test_pixels_brighter_than_32_bits_can_square_do_not_spoil_their_square():
    def glaring(n: int):
        values = independent(n)
        values[7] *= 1e25
        values[9] *= 1e16
        return values

    with np.errstate(over="ignore"):
        film = filled(glaring, 4)
    assert film._share == pytest.approx(np.ones_like(film._share), rel=0.4)

"""The weave's contrast and colours, unevenness and gaps, on pictures in which they are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from fabricusd.measure.flat.contrast import SlowContrast
from fabricusd.measure.flat.law import PATCH
from fabricusd.measure.flat.photograph import LUMINANCE, Photograph
from fabricusd.measure.flat.texture import gap_of, texture_of, unevenness_of
from fabricusd.measure.flat.weave import find_weave
from tests.measure.flat.pictures import woven

PITCH = (7.3, 6.9)


def seen(**given):
    photograph = woven("twill 2/1 S", PITCH, **given)
    return photograph, find_weave(photograph, "twill 2/1 S")[0]


def test_contrast_is_that_of_the_weave_without_the_grain():
    bare, lattice = seen(grain=0.0)
    grainy, _ = seen(grain=0.15)
    clean, noisy = (texture_of(p, lattice).contrast for p in (bare, grainy))
    y = bare.luminance
    assert clean == pytest.approx(y.std() / y.mean(), rel=0.1)
    assert noisy == pytest.approx(clean, rel=0.05)


def test_a_lens_hardly_changes_the_waves_that_tell_colours():
    bare, lattice = seen(grain=0.0)
    soft = replace(bare, linear=gaussian_filter(bare.linear, (0.6, 0.6, 0)))
    sharp, blurred = (texture_of(p, lattice) for p in (bare, soft))
    lost = np.log(sharp.slow / blurred.slow)
    assert 0.01 < lost < 0.8 * np.log(sharp.contrast / blurred.contrast)
    assert lost < sharp.slow_error < 0.2


def test_contrast_of_a_patch_is_that_of_the_waves_that_are_asked_for():
    x = np.arange(PATCH) + 0.5
    slow, fast = (np.cos(2 * np.pi * f * x) for f in (0.07, 0.21))
    row = np.stack((1 + 0.4 * slow + 0.3 * fast, 1 + 0.3 * fast, 1 - 0.2 * slow), axis=-1)
    picture = np.repeat(row[None], PATCH, axis=0)
    contrast, (red, green, blue) = SlowContrast(np.array([[0.07, 0.0]]))(picture)
    own = 0.4 * LUMINANCE[0] - 0.2 * LUMINANCE[2]
    assert contrast == pytest.approx(own / np.sqrt(2), rel=0.02)
    assert [red, green, blue] == pytest.approx([0.4 / own, 0.0, -0.2 / own], abs=0.1)
    y = picture @ LUMINANCE
    whole, _ = SlowContrast(np.zeros((0, 2)))(picture)
    assert whole == pytest.approx(y.std() / y.mean())


def test_channels_tell_that_threads_differ_in_colour():
    photograph, lattice = seen(shades=((0.5, 0.3, 0.2), (0.25, 0.3, 0.4)))
    red, green, blue = texture_of(photograph, lattice).channels
    assert red > 1.5
    assert abs(green) < 0.2
    assert blue < -1.5


def test_uneven_ends_are_told_from_even_picks_and_from_grain():
    wavy, lattice = seen(wobble=0.1, grain=0.02, shades=((0.5,) * 3, (0.45,) * 3))
    even, _ = seen(grain=0.05, shades=((0.5,) * 3, (0.45,) * 3))
    warp, weft = unevenness_of(wavy, lattice)
    # Two thirds of the picture are warp, and a tenth of their light varies.
    assert warp.shade == pytest.approx(0.08, rel=0.35)
    assert warp.low > 0
    assert 3 < warp.length <= 16
    assert warp.low < 0.1 < warp.high
    assert weft.low == 0
    assert all(one.low == 0 for one in unevenness_of(even, lattice))


def through(share):
    """Cloth lit from behind: specks of so large a share in the middle, where the lamp is."""
    rng = np.random.default_rng(0)
    linear = np.full((256, 256, 3), 0.1) * (1 + 0.1 * rng.standard_normal((256, 256, 1)))
    i, j = np.mgrid[:256, :256]
    specks = (np.hypot(i - 128, j - 128) < 20) & (rng.random((256, 256)) < share)
    linear[specks] = 1.0
    near = np.hypot(i - 128, j - 128) < 12
    return Photograph(name="behind", linear=np.clip(linear, 0, 1)), specks[near].mean()


@pytest.mark.parametrize("share", [0.05, 0.1])
def test_a_gap_is_the_share_of_specks(share):
    photograph, true = through(share)
    value, low, high = gap_of(photograph)
    assert value == pytest.approx(true, rel=0.1)
    assert low <= true * 1.1
    assert high >= true


def test_cloth_without_specks_has_no_gap_but_a_bound():
    assert gap_of(through(0.0)[0]) == (0.0, 0.0, 0.002)

"""Photographs that are none are refused in one line; cards and setups mean what they say."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.images.files import write_exr, write_png
from fabricusd.measure.flat.card import carded, lamp_of
from fabricusd.measure.flat.photograph import Photograph, read_photograph
from fabricusd.measure.flat.setup import Setup, turned

SETUP = Setup(light=(0.0, 1.0, 1.0), view_angle=40.0)


def exr(path, pixels):
    write_exr(path, {"beauty": pixels.astype(np.float32)}, {"beauty": ("R", "G", "B")}, {})
    return path


def test_eight_bits_are_srgb(tmp_path):
    write_png(tmp_path / "grey.png", np.full((130, 140, 3), 128, np.uint8))
    made = read_photograph(tmp_path / "grey.png")
    assert made.shape == (130, 140)
    assert made.linear == pytest.approx(0.2158605, rel=1e-4)


@pytest.mark.parametrize(
    ("pixels", "words"),
    [
        (np.full((200, 100, 3), 0.5), "100 x 200 pixels; it must have 128"),
        (np.full((200, 200, 3), np.nan), "120000 values that are not finite"),
        (np.zeros((200, 200, 3)), "is black"),
        (np.ones((200, 200, 3)), "saturated in 100%"),
    ],
    ids=["small", "nan", "black", "white"],
)
def test_what_is_no_photograph_is_refused(tmp_path, pixels, words):
    with pytest.raises(FabricError, match=words) as caught:
        read_photograph(exr(tmp_path / "a.exr", pixels))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "given",
    [
        {"light": (0, 1, -1)},
        {"light": (0, 1, math.nan)},
        {"light": (0, 1, 1), "back_light": (0, 0, 1)},
        {"light": (0, 1, 1), "view_angle": 0.0},
        {"light": (0, 1, 1), "width": -1.0},
    ],
)
def test_a_setup_that_cannot_be_is_refused(given):
    with pytest.raises(FabricError, match=r"--(light|back-light|view-angle|cloth-width)"):
        Setup(**given)


def test_the_middle_of_the_picture_is_lit_from_the_lamp():
    wi, wo, square = SETUP.pairs(np.zeros((1, 3)))
    assert wi[0] == pytest.approx([0, math.sqrt(0.5), math.sqrt(0.5)])
    assert wo[0] == pytest.approx([0, 0, 1])
    assert square[0] == pytest.approx(2.0)
    # Cloth that is turned to the left sees the lamp turned to the right.
    assert turned(wi, 0.1)[0, 0] > 0


def test_the_first_place_is_the_top_left_of_the_picture():
    places = SETUP.places((100, 200), 10)
    assert places.shape == (200, 3)
    assert places[0, 0] < 0 < places[0, 1]
    assert places[0, 1] == pytest.approx(SETUP.half * 0.9 * 0.5)


def test_a_card_tells_the_lamp_and_undoes_colour_and_dark_corners():
    shape = (160, 160)
    wi, wo, square = SETUP.pairs(SETUP.places(shape))
    light = (5.0 * wi[:, 2] / square).reshape(*shape, 1)
    lens = (wo[:, 2] ** 4).reshape(*shape, 1) * np.array([0.8, 1.0, 0.9])
    card = Photograph(name="card", linear=0.9 / math.pi * light * lens)
    cloth = Photograph(name="cloth", linear=0.3 / math.pi * light * lens)
    gain = lamp_of(card, SETUP, 0.9)
    mean = lens[70:90, 70:90].mean(axis=(0, 1)) @ [0.2126, 0.7152, 0.0722]
    assert gain == pytest.approx(5.0 * mean, rel=0.02)
    found = carded(cloth, card, SETUP, 0.9, gain).linear
    assert found == pytest.approx(gain * 0.3 / math.pi * light / 5.0 * np.ones(3), rel=0.05)


def test_a_card_that_is_saturated_is_refused():
    with pytest.raises(FabricError, match=r"card.*saturated"):
        lamp_of(Photograph(name="card", linear=np.ones((160, 160, 3))), SETUP, 0.9)

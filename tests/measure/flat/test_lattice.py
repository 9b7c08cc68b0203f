"""Pitches, turns and hands are those of the picture; what cannot be told is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.measure.flat.photograph import Photograph
from fabricusd.measure.flat.weave import find_weave, forms_of, other_face
from fabricusd.weaves import parse_weave
from tests.measure.flat.pictures import woven

CASES = (
    ("plain", (7.3, 8.2), 0.0),
    ("twill 2/1 S", (7.3, 6.9), 0.03),
    ("twill 2/1 Z", (7.3, 6.9), -0.03),
    ("twill 3/1 Z", (6.5, 8.3), 0.02),
    ("twill 2/2 S", (8.0, 8.9), 0.0),
    ("satin 5 step 2", (7.1, 6.4), 0.01),
    ("satin 5 step 3", (7.1, 6.4), 0.01),
    ("satin 8 step 3", (6.4, 6.3), 0.0),
)


@pytest.mark.parametrize(("weave", "pitch", "turn"), CASES, ids=[c[0] for c in CASES])
def test_a_weave_of_wide_threads_is_found_without_a_name(weave, pitch, turn):
    found, _ = find_weave(woven(weave, pitch, turn=turn), None)
    assert found.weave.name == weave
    assert found.pitch == pytest.approx(pitch, rel=0.01)
    assert found.turn == pytest.approx(turn, abs=math.radians(0.4))


@pytest.mark.parametrize("hand", ["S", "Z"])
@pytest.mark.parametrize("pitch", [(2.6, 3.1), (1.9, 2.9)], ids=["2.6 px", "1.9 px"])
def test_the_hand_of_a_fine_twill_whose_runs_are_named_is_found(hand, pitch):
    found, _ = find_weave(woven(f"twill 2/1 {hand}", pitch), "twill 2/1")
    assert found.weave.name == f"twill 2/1 {hand}"
    assert found.pitch == pytest.approx(pitch, rel=0.01)


@pytest.mark.parametrize("step", [2, 3])
def test_the_step_of_a_fine_satin_is_found(step):
    found, _ = find_weave(woven(f"satin 5 step {step}", (2.7, 3.1)), "satin 5")
    assert found.weave.name == f"satin 5 step {step}"
    assert found.pitch == pytest.approx((2.7, 3.1), rel=0.01)


def test_fine_threads_of_a_weave_without_a_name_are_refused_with_their_width():
    with pytest.raises(FabricError, match=r"pixels a thread.*at least 6: name the weave"):
        find_weave(woven("twill 2/1 Z", (3.1, 3.4)), None)


def test_a_picture_without_a_period_is_refused():
    rng = np.random.default_rng(0)
    grain = Photograph(name="grain.png", linear=np.clip(rng.normal(0.4, 0.05, (256, 256, 3)), 0, 1))
    for weave in (None, "plain"):
        with pytest.raises(FabricError, match=r"grain\.png.*period"):
            find_weave(grain, weave)


def test_forms_are_what_a_name_leaves_open():
    assert forms_of("twill 2/1") == ("twill 2/1 Z", "twill 2/1 S")
    assert forms_of("twill 2/1 S") == ("twill 2/1 S",)
    assert forms_of("satin 5") == ("satin 5 step 2", "satin 5 step 3")
    assert forms_of("plain") == ("plain",)


@pytest.mark.parametrize("name", ["twill 2/1 S", "satin 5 step 2", "satin 5 step 3 weft"])
def test_the_other_face_has_a_name_that_means_its_cells_but_for_a_shift(name):
    other = other_face(parse_weave(name).weave)
    meant = parse_weave(other.name).weave.cells
    m, n = meant.shape
    shifts = [np.roll(meant, (a, b), (0, 1)) for a in range(m) for b in range(n)]
    assert any(np.array_equal(other.cells, cells) for cells in shifts)

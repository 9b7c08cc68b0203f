"""The weight of cloth, both ways, and the crimp that it needs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.errors import FabricError
from fabricusd.fabric import DEGREE, Fabric, TangentCurve, Thread, ThreadSet
from fabricusd.weaves import parse_weave, to_fabric
from fabricusd.weaves.cloth import crimp, parse_weight, weight, with_weight, with_yarns
from fabricusd.weaves.yarn import TEX, diameter, parse_count
from tests import fuzz
from tests.strategies import fabrics

FLAT = Thread(linear_density=20 * TEX, thickness=2e-4)


def test_the_weight_of_straight_yarns_is_count_times_density() -> None:
    """20 tex at 30 ends and 20 picks per cm: (3000 + 2000) m of 0.02 g in a square metre."""
    fabric = Fabric(threads={"T": FLAT}, warp=ThreadSet(density=3000), weft=ThreadSet(density=2000))
    found = weight(fabric)
    assert found.warp == pytest.approx(0.060)
    assert found.total == pytest.approx(0.100)
    assert "100 g/m2, 2.95 oz/yd2" in str(found)


@given(st.lists(st.tuples(st.floats(0, 2), st.floats(-80, 80)), min_size=2, max_size=6))
def test_crimp_is_the_length_of_the_curve(points) -> None:
    lengths = [length for length, _ in points[1:]]
    if sum(lengths) < 1e-3:
        return
    curve = TangentCurve.from_lengths([angle * DEGREE for _, angle in points], lengths)
    x = np.linspace(0, sum(lengths), 20_001)
    middles = (x[1:] + x[:-1]) / 2
    angles = np.interp(middles, curve.positions, curve.angles)
    walked = float((np.diff(x) / np.cos(angles)).sum()) / sum(lengths) - 1
    assert crimp(curve) == pytest.approx(walked, rel=2e-3, abs=2e-3)


def test_crimped_cloth_is_heavier_by_its_crimp() -> None:
    curved = replace(FLAT, curve=TangentCurve(angles=(-30 * DEGREE, 30 * DEGREE)))
    flat, crimped = Fabric(threads={"T": FLAT}), Fabric(threads={"T": curved})
    extra = math.atanh(0.5) / (math.pi / 6) - 1
    assert weight(crimped).total == pytest.approx(weight(flat).total * (1 + extra))


def test_the_weight_of_pile_is_not_known() -> None:
    pile = replace(FLAT, curve=TangentCurve(angles=(-90 * DEGREE, 90 * DEGREE)))
    assert weight(Fabric(threads={"T": pile})) is None
    with pytest.raises(FabricError, match="--weight cannot be met"):
        with_weight(Fabric(threads={"T": pile}), 0.3)


@settings(max_examples=40)
@given(fabrics(back=False), st.floats(0.01, 2))
def test_a_fabric_of_a_weight_has_it_and_keeps_its_densities(fabric: Fabric, wanted: float) -> None:
    if weight(fabric) is None:
        return
    made = with_weight(fabric, wanted)
    assert weight(made).total == pytest.approx(wanted)
    assert (made.warp.density, made.weft.density) == (fabric.warp.density, fabric.weft.density)


def test_a_thickness_that_was_given_stays_at_another_weight() -> None:
    made = with_weight(Fabric(threads={"T": FLAT}), 0.5, keep_thickness=True)
    assert {thread.thickness for thread in made.thread_list} == {2e-4}
    made = with_weight(Fabric(threads={"T": FLAT}), 0.5)
    assert {thread.thickness for thread in made.thread_list} != {2e-4}


def test_warp_and_weft_of_one_thread_become_two_of_their_counts() -> None:
    fabric = to_fabric(parse_weave("plain"))
    made = with_yarns(fabric, warp=parse_count("Ne 30"), weft=parse_count("Ne 20"))
    warp, weft = (made.thread_list[s.sequence[0]] for s in (made.warp, made.weft))
    assert list(made.threads) == ["Thread", "Thread_2"]
    assert warp.thickness == diameter(parse_count("Ne 30"))
    assert weft.linear_density == parse_count("Ne 20")


def test_equal_counts_leave_one_thread() -> None:
    count = parse_count("Ne 30")
    made = with_yarns(to_fabric(parse_weave("plain")), warp=count, weft=count)
    assert list(made.threads) == ["Thread"]


def test_a_given_thickness_precedes_that_of_the_count() -> None:
    count = parse_count("Ne 30")
    made = with_yarns(Fabric(), warp=count, weft=count, thickness=3e-4)
    assert made.thread_list[0].thickness == 3e-4
    assert made.thread_list[0].linear_density == count


@pytest.mark.parametrize(
    ("text", "grams"),
    [("14oz", 474.7), ("14 oz/yd2", 474.7), ("470gsm", 470), ("470 g/m2", 470), ("470 g/m²", 470)],
)
def test_a_weight_is_read_in_its_unit(text: str, grams: float) -> None:
    assert parse_weight(text) * 1e3 == pytest.approx(grams, abs=0.05)


@pytest.mark.parametrize("text", ["", "14", "oz", "14 lb", "-3oz", "0oz", "1e3gsm", "99999oz"])
def test_what_is_no_weight_is_refused(text: str) -> None:
    with pytest.raises(FabricError, match="--weight is '"):
        parse_weight(text)


@settings(max_examples=fuzz.examples(100, 20_000))
@given(st.text(st.sampled_from("0123456789 ./ozgsmyd2²\0é"), max_size=12))
def test_any_text_is_a_weight_or_one_line_of_error(text: str) -> None:
    fuzz.refusal(parse_weight, text)

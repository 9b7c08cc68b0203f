"""The height field: real lengths, flat or round threads, what has no height."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.shadow.height import height_field, highest_point
from fabricusd.appearance.weave.bands import seen_length
from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.errors import FabricError
from fabricusd.fabric import DEGREE, Fabric, TangentCurve, Thread, ThreadSet, Weave
from tests.appearance.presets import PLAIN, PRESETS
from tests.strategies import fabrics

HUMP = TangentCurve(positions=(0, 1), angles=(-25 * DEGREE, 25 * DEGREE))
RISE = -math.log(math.cos(25 * DEGREE)) / (50 * DEGREE)


def cloth(weave: Weave, curve: TangentCurve, thickness: float = 0.2e-3) -> Fabric:
    return Fabric(
        threads={"T": Thread(curve=curve, thickness=thickness)},
        weave=weave,
        warp=ThreadSet(density=1000.0, coverage=0.4),
        weft=ThreadSet(density=500.0, coverage=0.4),
    )


def test_a_hump_is_as_high_as_its_float_is_long() -> None:
    # A warp thread over k picks of 2 mm each.
    for k in (1, 2, 4):
        cells = np.ones((2, k + 1), bool)
        cells[:, k] = False
        fabric = cloth(Weave(cells), HUMP)
        hit = lookup(fabric, [[0.5, k / 2]])
        # It is seen on to the edges of the picks that cross over it.
        seen = seen_length(k, float(coverage(fabric).width[WEFT]))
        assert hit.height[0] == pytest.approx(RISE * seen * 2e-3)
        found = highest_point(fabric, compile_fabric(fabric, precision=np.float64))
        weft = RISE * 2 * 1e-3  # two ends, 1 mm each, over which the weft floats without end
        assert found == pytest.approx(max(RISE * seen * 2e-3, weft) + 0.1e-3)


def test_straight_threads_stand_half_their_thickness_above_the_cloth() -> None:
    field = height_field(cloth(PLAIN, TangentCurve()), (20, 20))
    np.testing.assert_allclose(np.unique(field), [0.0, 0.1e-3])


def test_round_threads_fall_to_the_axis_at_their_edges() -> None:
    fabric = cloth(PLAIN, TangentCurve())
    flat, round_ = height_field(fabric, (400, 4)), height_field(fabric, (400, 4), level="thread")
    on = flat > 0
    assert (round_[on] <= flat[on]).all()
    # The mean of sqrt(1 - w^2) over the width is pi/4.
    u = (np.arange(400) + 0.5) / 400 * 2
    warp = lookup(fabric, np.stack((u, np.full(400, 0.25)), axis=1)).set == WARP
    assert round_[warp, 0].mean() / flat[warp, 0].mean() == pytest.approx(math.pi / 4, rel=1e-2)


def test_a_thread_of_unknown_thickness_is_as_thick_as_it_looks_or_as_fits() -> None:
    flat = cloth(PLAIN, TangentCurve(), thickness=0.0)
    one_way = replace(flat, weave=Weave(np.ones((1, 1), bool)), weft=ThreadSet(coverage=0.0))
    compiled = compile_fabric(one_way, precision=np.float64)
    assert compiled.half_height[WARP, 0] == pytest.approx(0.5 * 0.4e-3)
    crossed = compile_fabric(cloth(PLAIN, HUMP, thickness=0.0), precision=np.float64)
    looks = 0.5 * coverage(cloth(PLAIN, HUMP)).width * [2e-3, 1e-3]
    assert (crossed.half_height[:, 0] < looks).all()
    assert (crossed.half_height[:, 0] > 0.1 * looks).all()


@given(fabrics(back=False))
def test_no_point_is_higher_than_the_highest(fabric: Fabric) -> None:
    compiled = compile_fabric(fabric, precision=np.float64)
    top = highest_point(fabric, compiled)
    field = height_field(fabric, (97, 101))
    assert np.isfinite(field).all()
    assert field.max() <= top * (1 + 1e-9)
    rounded = height_field(fabric, (97, 101), level="thread")
    assert rounded.max() <= top * (1 + 1e-9)


@pytest.mark.parametrize("name", [n for n in PRESETS if n != "velvet"])
def test_the_highest_point_is_reached(name: str) -> None:
    fabric = PRESETS[name]
    top = highest_point(fabric, compile_fabric(fabric, precision=np.float64))
    assert height_field(fabric, (501, 501)).max() == pytest.approx(top, rel=2e-3)


def test_pile_has_no_height() -> None:
    velvet = PRESETS["velvet"]
    assert not height_field(velvet, (30, 30)).any()
    assert highest_point(velvet, compile_fabric(velvet, precision=np.float64)) == 0


def test_a_type_counts_only_at_the_runs_that_it_meets() -> None:
    # Ends 0 float over 3 picks, ends 1 over none; the tall type lies on ends 1 alone.
    cells = np.array([[True, True, True, False], [False, False, False, False]])
    tall = Thread(curve=TangentCurve(angles=(-60 * DEGREE, 60 * DEGREE)), thickness=1e-6)
    flat = Thread(thickness=1e-6)
    fabric = Fabric(
        threads={"flat": flat, "tall": tall},
        weave=Weave(cells),
        warp=ThreadSet(sequence=(0, 1), coverage=0.3),
        weft=ThreadSet(sequence=(0,), coverage=0.6),
    )
    top = highest_point(fabric, compile_fabric(fabric, precision=np.float64))
    assert top == pytest.approx(0.5e-6)
    other = replace(fabric, warp=ThreadSet(sequence=(1, 0), coverage=0.3))
    assert highest_point(other, compile_fabric(other, precision=np.float64)) > 1e-4


def test_other_levels_and_empty_fields_are_refused() -> None:
    with pytest.raises(FabricError, match="it must be 'weave' or 'thread'"):
        height_field(PRESETS["linen_plain"], (4, 4), level="far")
    with pytest.raises(FabricError, match="at least 1 by 1"):
        height_field(PRESETS["linen_plain"], (0, 4))

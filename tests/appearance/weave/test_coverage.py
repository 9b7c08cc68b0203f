"""Coverage wins over the grid: what each set and thread type shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.fabric import Fabric, Thread, ThreadSet, Weave
from tests.appearance.presets import PLAIN, PRESETS, SATIN_5
from tests.strategies import fabrics

ALL_WARP = Weave(np.ones((2, 3), bool), "all warp")
NO_WIDTH = Thread(thickness=0.0)


def cloth(weave: Weave, warp: float | None, weft: float | None, **more: object) -> Fabric:
    return Fabric(weave=weave, warp=ThreadSet(coverage=warp), weft=ThreadSet(coverage=weft), **more)  # type: ignore[arg-type]


RULES = {
    # weave, warp, weft -> (weft, warp) width, gap
    "linen: both less than their cells": (PLAIN, 0.33, 0.33, (0.416905, 0.416905), 0.34),
    "satin: the warp takes what the weft leaves": (SATIN_5, 0.9, 0.1, (0.5, 1), 0.0),
    "the rest is gap": (SATIN_5, 0.85, 0.1, (0.378301, 0.919575), 0.05),
    "exactly the cells": (SATIN_5, 0.8, 0.2, (1, 1), 0.0),
    "nowhere on top, and yet seen": (ALL_WARP, 0.7, 0.2, (2 / 3, 0.7), 0.1),
    "nowhere on top, filling the rest": (ALL_WARP, 0.75, 0.25, (1.0, 0.75), 0.0),
    "a set that covers nothing": (PLAIN, 0.0, 0.4, (0.4, 0.0), 0.6),
    "nothing at all": (PLAIN, 0.0, 0.0, (0.0, 0.0), 1.0),
    "one set everywhere": (PLAIN, 1.0, 0.0, (0.0, 1.0), 0.0),
}


@pytest.mark.parametrize("row", RULES.values(), ids=RULES.keys())
def test_bands_are_as_wide_as_shows_the_stated_areas(row) -> None:  # type: ignore[no-untyped-def]
    weave, warp, weft, width, gap = row
    share = coverage(cloth(weave, warp, weft))
    np.testing.assert_allclose(share.width, width, atol=1e-6)
    assert share.gap == pytest.approx(gap, abs=1e-12)
    np.testing.assert_allclose(share.type_area.sum(axis=1), [weft, warp], atol=1e-12)


@given(fabrics())
def test_areas_and_gap_are_shares_of_one(fabric: Fabric) -> None:
    share = coverage(fabric)
    assert (share.area >= 0).all()
    assert (share.type_area >= 0).all()
    np.testing.assert_allclose(share.type_area.sum(axis=1), share.area, atol=1e-9)
    assert share.area.sum() + share.gap == pytest.approx(1.0, abs=1e-9)
    for j, thread_set in ((WEFT, fabric.weft), (WARP, fabric.warp)):
        if thread_set.coverage is not None:
            assert share.area[j] == pytest.approx(thread_set.coverage, abs=1e-7)
        else:
            # No wider than its threads are thick.
            assert share.width[j] <= min(1.0, 1e-7 + thickest(fabric) / thread_set.pitch)


def thickest(fabric: Fabric) -> float:
    return max(t.thickness or np.inf for t in fabric.thread_list)


def test_bands_without_a_coverage_are_as_wide_as_threads_are_thick() -> None:
    thin = Thread(thickness=0.3e-3)
    fabric = cloth(SATIN_5, None, None, threads={"T": thin})
    for per_metre, wide in ((1000.0, 0.3), (5000.0, 1.0)):
        weft = ThreadSet(density=per_metre)
        share = coverage(replace(fabric, warp=ThreadSet(density=2000.0), weft=weft))
        np.testing.assert_allclose(share.width, [wide, 0.6])
        assert share.area[WARP] == pytest.approx(0.6 * (0.8 + 0.2 * (1 - wide)))
        assert share.area[WEFT] == pytest.approx(wide * (0.2 + 0.8 * 0.4))
        assert share.gap == pytest.approx((1 - wide) * 0.4)


def test_a_set_without_a_coverage_keeps_its_width_beside_one_that_has_one() -> None:
    thin = Thread(thickness=0.3e-3)
    fabric = cloth(SATIN_5, 0.5, None, threads={"T": thin})
    fabric = replace(fabric, weft=ThreadSet(density=1000.0))
    share = coverage(fabric)
    assert share.area[WARP] == pytest.approx(0.5)
    assert share.width[WEFT] == pytest.approx(0.3)


def test_a_thread_of_unknown_thickness_fills_its_pitch() -> None:
    share = coverage(cloth(PLAIN, None, None, threads={"T": NO_WIDTH}))
    np.testing.assert_allclose(share.area, [0.5, 0.5])
    assert share.gap == 0


def test_an_unauthored_coverage_leaves_room_for_the_authored_one() -> None:
    share = coverage(cloth(SATIN_5, 0.95, None, threads={"T": NO_WIDTH}))
    np.testing.assert_allclose(share.area, [0.05, 0.95])


def test_types_share_their_set_by_the_cells_where_they_are_on_top() -> None:
    # Ends 0, 2, 4 are on top in every cell, 1, 3, 5 in none; type 0 has every third end.
    cells = np.zeros((6, 1), bool)
    cells[::2] = True
    fabric = Fabric(
        threads={"A": Thread(), "B": Thread()},
        weave=Weave(cells),
        warp=ThreadSet(sequence=(0, 1, 1), coverage=0.25),
        weft=ThreadSet(sequence=(1,), coverage=0.5),
    )
    share = coverage(fabric)
    np.testing.assert_allclose(share.type_area, [[0.0, 0.5], [0.25 / 3, 0.25 * 2 / 3]])


def test_a_type_that_is_always_on_top_gains_nothing_underneath() -> None:
    # The remainder lies on the *other* cells, and only B's ends have any: the shares of the types
    # cannot be those of the cells on top, which MODEL section 3 has for every coverage.
    cells = np.array([[True, True], [False, False]])
    fabric = Fabric(
        threads={"A": Thread(), "B": Thread()},
        weave=Weave(cells),
        warp=ThreadSet(sequence=(0, 1), coverage=0.7),
        weft=ThreadSet(sequence=(0,), coverage=0.3),
    )
    np.testing.assert_allclose(coverage(fabric).type_area[WARP], [0.5, 0.2])


@pytest.mark.parametrize("fabric", PRESETS.values(), ids=PRESETS.keys())
def test_published_fabrics_cover_what_is_published(fabric: Fabric) -> None:
    share = coverage(fabric)
    assert share.area[WARP] == pytest.approx(fabric.warp.coverage, abs=1e-12)
    assert share.area[WEFT] == pytest.approx(fabric.weft.coverage, abs=1e-12)

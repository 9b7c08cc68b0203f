"""The weave under a point: exact for every grid, sequence, coverage and coordinate."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.compiled import compile_fabric, true_repeat
from fabricusd.appearance.weave.coverage import GAP, coverage
from fabricusd.appearance.weave.curve import height_at, is_pile
from fabricusd.appearance.weave.lookup import back_of, find_all, lookup
from fabricusd.appearance.weave.sections import sections
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric, TangentCurve, Thread, ThreadSet, Weave, even
from fabricusd.sides import Sides
from tests.appearance.presets import PLAIN, PRESETS, SATIN_5
from tests.appearance.weave.slow_weave import slow_lookup
from tests.strategies import fabrics


def cell_rectangles(fabric: Fabric) -> np.ndarray:
    """(n, 4) left, bottom, width, height of rectangles that tile the true repeat, each inside one
    stretch of one thread: cut where any set may begin or end in any cell."""
    share = coverage(fabric)
    widths = np.array([1.0, *share.width])
    cuts = np.unique(np.concatenate(([0.5], 0.5 - widths / 2, 0.5 + widths / 2)))
    ends, picks = true_repeat(fabric)
    low, step = cuts[:-1], np.diff(cuts)
    x = (np.arange(ends)[:, None] + low).ravel()
    y = (np.arange(picks)[:, None] + low).ravel()
    a, b = np.tile(step, ends), np.tile(step, picks)
    left, bottom = np.meshgrid(x, y, indexing="ij")
    wide, high = np.meshgrid(a, b, indexing="ij")
    return np.stack([left.ravel(), bottom.ravel(), wide.ravel(), high.ravel()], axis=1)


def small(fabric: Fabric) -> Fabric:
    """The fabric with sequences short enough for its whole repeat to be looked at."""
    return replace(
        fabric,
        warp=replace(fabric.warp, sequence=fabric.warp.sequence[:3]),
        weft=replace(fabric.weft, sequence=fabric.weft.sequence[:3]),
    )


@given(fabrics(back=False), st.integers(0, 2**32 - 1))
def test_lookup_is_what_walking_along_the_threads_finds(fabric: Fabric, seed: int) -> None:
    uv = np.random.default_rng(seed).uniform(-40, 40, (40, 2))
    hit = lookup(fabric, uv)
    for k, (u, v) in enumerate(uv):
        slow = slow_lookup(fabric, u, v)
        if slow.edge < 1e-9:
            continue
        assert (hit.set[k], hit.thread[k]) == (slow.set, slow.thread)
        assert hit.gap[k] == (slow.set == GAP)
        assert hit.position[k] == pytest.approx(slow.position, abs=1e-9)
        assert hit.across[k] == pytest.approx(slow.across, abs=1e-9)
        assert hit.angle[k] == pytest.approx(slow.angle, abs=1e-7)


@given(fabrics(back=False))
def test_each_type_covers_exactly_its_share_and_shows_its_curve_evenly(fabric: Fabric) -> None:
    fabric = small(fabric)
    cloth = compile_fabric(fabric, precision=np.float64)
    r = cell_rectangles(fabric)
    total = math.prod(true_repeat(fabric))
    area = np.zeros((3, len(fabric.threads)))
    moments = np.zeros((2, 3))
    # Positions are linear inside a rectangle, so two Gauss points a side are exact for cubes.
    for gx in (-1, 1):
        for gy in (-1, 1):
            at = r[:, :2] + r[:, 2:] * (0.5 + 0.5 * np.array([gx, gy]) / math.sqrt(3))
            hit = lookup(cloth, at)
            weight = r[:, 2] * r[:, 3] / 4 / total
            np.add.at(area, (hit.set, hit.thread), weight)
            for j in (WEFT, WARP):
                on = hit.set == j
                powers = [np.sum(weight[on] * hit.position[on] ** p) for p in (1, 2, 3)]
                moments[j] += powers
    np.testing.assert_allclose(area[:2], cloth.area, atol=1e-9)
    assert area[GAP].sum() == pytest.approx(float(cloth.gap), abs=1e-9)
    expected = np.outer(cloth.area.sum(axis=1), [1 / 2, 1 / 3, 1 / 4])
    np.testing.assert_allclose(moments, expected, atol=1e-9)


@pytest.mark.parametrize("fabric", PRESETS.values(), ids=PRESETS.keys())
@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_the_place_in_a_thread_is_the_same_ten_thousand_repeats_away(fabric, precision) -> None:  # type: ignore[no-untyped-def]
    # Uneven threads are other ones there.
    fabric = even(fabric)
    cloth = compile_fabric(fabric, precision=precision)
    rng = np.random.default_rng(1)
    repeat = np.array(true_repeat(fabric))
    # Fractions of 2^-20 survive the addition in float64, so the answer must be identical.
    uv = rng.integers(0, 2**20 * repeat, (4000, 2)) / 2**20
    near = lookup(cloth, uv)
    for shift in ([1e4, 1e4], [-1e4, 3], [-7, -123456]):
        far = lookup(cloth, uv + repeat * np.array(shift))
        for name, a, b in zip(near._fields, near, far, strict=True):
            # Threads and places are counted from the corner of the cloth, not of the repeat.
            if name not in ("number", "even_uv"):
                np.testing.assert_array_equal(a, b)


def test_float32_coordinates_would_lose_the_place_in_the_thread() -> None:
    cloth = compile_fabric(PRESETS["linen_plain"], precision=np.float32)
    uv = np.random.default_rng(1).uniform(1e4, 1.0001e4, (4000, 2))
    kept = lookup(cloth, uv)
    lost = lookup(cloth, uv.astype(np.float32).astype(np.float64))
    both = ~kept.gap & ~lost.gap & (kept.set == lost.set)
    assert np.abs(kept.position - lost.position)[both].max() > 2.5e-4


@pytest.mark.parametrize("fabric", PRESETS.values(), ids=PRESETS.keys())
def test_float32_agrees_with_float64_to_rounding(fabric: Fabric) -> None:
    uv = np.random.default_rng(2).uniform(-1e4, 1e4, (20000, 2))
    exact = lookup(compile_fabric(fabric, precision=np.float64), uv)
    quick = lookup(compile_fabric(fabric, precision=np.float32), uv)
    same = exact.set == quick.set
    assert np.count_nonzero(~same) <= 2  # within a rounding of an edge
    for name, unit in (("position", 1.0), ("across", 1.0), ("height", 1e-3), ("crown", 1e-3)):
        error = np.abs(getattr(exact, name) - getattr(quick, name))[same] / unit
        assert np.quantile(error, 0.999) < 2e-6, name
    assert np.quantile(np.abs(exact.angle - quick.angle)[same], 0.999) < 2e-6


def test_sequences_repeat_on_their_own_whatever_the_grid() -> None:
    kinds = tuple(Thread(gamma_surface=0.1 * (k + 1)) for k in range(4))
    fabric = Fabric(
        threads={f"T{k}": t for k, t in enumerate(kinds)},
        weave=PLAIN,
        warp=ThreadSet(sequence=(0, 1, 2), coverage=0.5),
        weft=ThreadSet(sequence=(3, 3, 2, 1, 0), coverage=0.5),
    )
    assert true_repeat(fabric) == (6, 10)
    u, v = np.meshgrid(np.arange(-30, 30) + 0.5, np.arange(-30, 30) + 0.5, indexing="ij")
    hit = lookup(fabric, np.stack([u.ravel(), v.ravel()], axis=1))
    end, pick = np.floor(u.ravel()).astype(int), np.floor(v.ravel()).astype(int)
    warp = np.array(fabric.warp.sequence)[end % 3]
    weft = np.array(fabric.weft.sequence)[pick % 5]
    np.testing.assert_array_equal(hit.thread, np.where(hit.set == WARP, warp, weft))


def test_across_grows_along_b_of_the_thread_frame() -> None:
    # b = n_t x t: with U x V = N it is +V on the weft and -U on the warp.
    fabric = Fabric(weave=PLAIN, warp=ThreadSet(coverage=0.5), weft=ThreadSet(coverage=0.5))
    hit = lookup(fabric, [[0.25, 0.5], [0.75, 0.5], [1.5, 0.25], [1.5, 0.75]])
    np.testing.assert_array_equal(hit.set, [WARP, WARP, WEFT, WEFT])
    np.testing.assert_allclose(hit.across, [0.5, -0.5, -0.5, 0.5])


def test_a_float_shows_its_curve_once_even_round_the_border_of_the_repeat() -> None:
    lean = TangentCurve(positions=(0, 1), angles=(-0.5, 0.5))
    cells = np.array([[1, 1, 0, 1]], bool)  # one end: over picks 3, 0, 1; under pick 2
    fabric = Fabric(
        threads={"T": Thread(curve=lean)},
        weave=Weave(cells),
        warp=ThreadSet(coverage=0.75),
        weft=ThreadSet(coverage=0.25),
    )
    hit = lookup(fabric, [[0.5, 3.0], [0.5, 4.5], [0.5, 5.75], [0.5, -0.5]])
    np.testing.assert_allclose(hit.position, [0, 0.5, 2.75 / 3, 0.5 / 3])
    np.testing.assert_allclose(hit.angle, -0.5 + hit.position, atol=1e-12)
    # The weft has one end in its repeat, always on top where pick 2 is: a run without end.
    endless = lookup(fabric, [[0.0, 2.5], [0.25, 2.5], [5.25, 2.5]])
    np.testing.assert_allclose(endless.position, [0, 0.25, 0.25])


def test_a_single_cell_is_a_repeat() -> None:
    fabric = Fabric(
        weave=Weave(np.array([[True]])), warp=ThreadSet(coverage=0.6), weft=ThreadSet(coverage=0.3)
    )
    hit = lookup(fabric, [[0.5, 0.25], [-3.5, 7.25], [0.1, 0.5], [0.1, 0.01]])
    np.testing.assert_array_equal(hit.set, [WARP, WARP, WEFT, GAP])
    np.testing.assert_allclose(hit.position[:2], 0.25)
    assert hit.position[2] == pytest.approx(0.1 / 0.4)


def test_a_set_seen_only_underneath_shows_its_whole_curve() -> None:
    fabric = Fabric(
        weave=Weave(np.ones((3, 1), bool)),
        warp=ThreadSet(coverage=0.8),
        weft=ThreadSet(coverage=0.2),
    )
    # Strips of 0.1 on both sides of each warp thread; three of them are the endless run.
    hit = lookup(fabric, [[0.0, 0.5], [0.05, 0.5], [0.95, 0.5], [2.95, 0.5]])
    np.testing.assert_array_equal(hit.set, WEFT)
    np.testing.assert_allclose(hit.position, [0, 0.25 / 3, 0.75 / 3, 2.75 / 3], atol=1e-12)


def test_a_set_that_covers_nothing_is_never_hit() -> None:
    fabric = Fabric(weave=PLAIN, warp=ThreadSet(coverage=0.0), weft=ThreadSet(coverage=0.5))
    hit = lookup(fabric, np.random.default_rng(0).uniform(0, 2, (5000, 2)))
    assert not (hit.set == WARP).any()
    assert abs((hit.set == WEFT).mean() - 0.5) < 0.03
    assert np.isfinite(np.stack([hit.angle, hit.position, hit.height])).all()


def test_vertical_tangents_stay_finite_and_have_no_height() -> None:
    hit = lookup(PRESETS["velvet"], np.random.default_rng(0).uniform(0, 2, (5000, 2)))
    assert np.isfinite(hit.angle).all()
    assert hit.angle.min() == pytest.approx(-math.pi / 2, abs=1e-2)
    assert not hit.height.any()


@pytest.mark.parametrize("fabric", PRESETS.values(), ids=PRESETS.keys())
def test_height_is_the_curve_s_over_the_real_length_of_the_run(fabric: Fabric) -> None:
    uv = np.random.default_rng(3).uniform(0, 30, (300, 2))
    hit, fitted = lookup(fabric, uv), sections(fabric)
    for k, (u, v) in enumerate(uv):
        if hit.gap[k]:
            continue
        slow = slow_lookup(fabric, u, v)
        kind, j = int(hit.thread[k]), int(hit.set[k])
        curve = fabric.thread_list[kind].curve
        crossing = (fabric.weft if j == WARP else fabric.warp).pitch
        expected = slow.length * crossing * float(height_at(curve, slow.position))
        lift = fitted.lift if j == WEFT and not is_pile(curve) else 0.0
        assert hit.height[k] == pytest.approx(expected + lift, abs=1e-12)
        half = fitted.half_height[j, kind]
        assert hit.crown[k] == pytest.approx(half * math.sqrt(1 - hit.across[k] ** 2), abs=1e-12)


def test_a_mirrored_back_is_in_all_else_the_front():
    front = replace(
        PRESETS["linen_plain"], surface_law="projected", opaque=True, masking_width=0.3,
        unevenness_seed=7, documentation="told", sides=Sides(reflected=(0.4,)),
    )  # fmt: skip
    back = back_of(front)
    kept = replace(back, weave=front.weave, warp=front.warp, weft=front.weft)
    assert kept == front


@given(fabrics(back=False))
def test_the_back_of_the_back_is_the_front(fabric: Fabric) -> None:
    once = back_of(fabric)
    twice = back_of(once)
    assert coverage(once).gap == pytest.approx(coverage(fabric).gap, abs=1e-9)
    np.testing.assert_array_equal(twice.weave.cells, fabric.weave.cells)
    assert twice.warp.sequence == fabric.warp.sequence
    assert twice.weft.sequence == fabric.weft.sequence
    front, behind = coverage(fabric), coverage(once)
    # A set that the back hides altogether has no area there to tell its width by.
    if (behind.area[front.width > 0] > 1e-6).all():
        np.testing.assert_allclose(coverage(twice).area, front.area, atol=1e-6)
        np.testing.assert_allclose(behind.width, front.width, atol=1e-6)


def test_behind_a_thread_on_top_is_the_one_that_it_crosses() -> None:
    kinds = {f"T{k}": Thread(gamma_surface=0.1 * (k + 1)) for k in range(5)}
    fabric = Fabric(
        threads=kinds,
        weave=SATIN_5,
        warp=ThreadSet(sequence=(0, 1), coverage=0.8),
        weft=ThreadSet(sequence=(2, 3, 4), coverage=0.2),
    )
    uv = np.random.default_rng(0).uniform(-9, 9, (2000, 2))
    front, back = lookup(fabric, uv), lookup(back_of(fabric), uv * [1, -1])
    np.testing.assert_array_equal(front.set, 1 - back.set)
    # At one place the front's end and the back's pick are the two threads that cross there.
    end, pick = np.floor(uv).astype(int).T
    np.testing.assert_array_equal(
        np.where(back.set == WARP, np.array([0, 1])[end % 2], np.array([2, 3, 4])[pick % 3]),
        back.thread,
    )


def test_a_named_back_is_taken_as_it_is() -> None:
    other = PRESETS["polyester_satin_charmeuse_back"]
    assert back_of(replace(PRESETS["polyester_satin_charmeuse"], back=other)) is other


BAD = {
    "not a number": [0.5, math.nan],
    "infinite": [math.inf, 0.5],
    "so far out that no fraction is left": [1e17, 0.5],
}


@pytest.mark.parametrize("place", BAD.values(), ids=BAD.keys())
def test_coordinates_without_a_place_are_counted_and_named(place: list[float]) -> None:
    with pytest.raises(FabricError, match=r"has 1 of 3 places .* the first at 1"):
        lookup(PRESETS["linen_plain"], [[0, 0], place, [1, 1]])
    cloth = compile_fabric(PRESETS["linen_plain"], precision=np.float32)
    sets, threads = np.empty(1, np.uint8), np.empty(1, np.int32)
    numbers = np.zeros((4, 1), np.float32)
    find_all(np.float32, cloth, np.array([place]), sets, threads, *numbers)
    assert threads[0] == 0
    assert np.isnan(numbers).all()


def test_coordinates_of_another_shape_are_refused() -> None:
    with pytest.raises(FabricError, match=r"has shape \(3,\); it must be \(n, 2\)"):
        lookup(PRESETS["linen_plain"], [0, 1, 2])


def test_no_places_give_no_hits() -> None:
    assert lookup(PRESETS["linen_plain"], np.zeros((0, 2))).set.shape == (0,)

"""Shadows and the weave at a block of places, against one place at a time."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numba import njit

from fabricusd.appearance.shadow.kinds import Shadow
from fabricusd.appearance.shadow.mean import (
    ELEVATION,
    SECTORS,
    bounds_of,
    level_of,
    mean_over,
    stretch_of,
)
from fabricusd.appearance.shadow.methods import compile_shadow, lit_all, shade
from fabricusd.appearance.shadow.place_blocks import (
    ANGLE,
    FREE,
    INT_ROWS,
    OF_SET,
    OF_THREAD,
    PIECE,
    REAL_ROWS,
    S,
    look_up_block,
)
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.curve import is_pile, pieces
from fabricusd.appearance.weave.lookup import find, lookup
from fabricusd.appearance.weave.place import Hit
from fabricusd.fabric import DEGREE, Fabric, TangentCurve, ThreadSet, Weave
from fabricusd.kernels.real import BLOCK, KERNEL
from tests.appearance.presets import PRESETS

SATIN = replace(PRESETS["polyester_satin_charmeuse"], surface_law="masked")


def of_many_types() -> Fabric:
    """Nine types of thread, one of them pile, with more pieces than are compared one by one."""
    first = next(iter(SATIN.threads.values()))
    steps = np.array([-30.0, -20.0, 0.0, 0.0, 20.0, 30.0])
    threads = {
        f"t{k}": replace(
            first,
            curve=TangentCurve.from_lengths(
                (a * DEGREE for a in steps * (0.5 + 0.05 * k)), (1, 0.4, 2, 0.4, 1 + 0.1 * k)
            ),
        )
        for k in range(8)
    }
    threads["pile"] = next(t for t in PRESETS["velvet"].thread_list if is_pile(t.curve))
    i, j = np.indices((4, 4))
    return Fabric(
        threads=threads,
        weave=Weave((i + j) % 4 < 2, "twill"),
        warp=ThreadSet(sequence=(0, 1, 2, 8), density=4000.0, coverage=0.5),
        weft=ThreadSet(sequence=(3, 4, 5, 6, 7), density=3000.0, coverage=0.5),
        surface_law="masked",
    )


FABRICS = {
    "few": SATIN,
    "gaps": replace(PRESETS["linen_plain"], surface_law="masked"),
    "many": of_many_types(),
}


def seen(fabric: Fabric, seed: int, count: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Places, and light from all of the sky and from below."""
    generator = np.random.default_rng(seed)
    uv = generator.uniform(-40.0, 40.0, (count, 2))
    w = generator.standard_normal((3, count))
    w /= np.sqrt((w * w).sum(axis=0))
    w[2] = np.where(np.arange(count) % 10 > 0, np.abs(w[2]), w[2])
    return uv, np.ascontiguousarray(w)


@njit(**{**KERNEL, "cache": False})
def one_by_one(R, cloth, shadow, uv, wi, out):  # type: ignore[no-untyped-def]
    for k in range(out.size):
        u, v = uv[k, 0], uv[k, 1]
        which, thread, s, w, _, length = find(R, cloth, u, v)
        hit = Hit(which, thread, s, w, length)
        out[k] = shade(R, cloth, shadow, u, v, hit, wi[0, k], wi[1, k], wi[2, k])


@pytest.mark.parametrize("name", FABRICS)
def test_a_block_is_shaded_as_its_places_are(name: str) -> None:
    fabric = FABRICS[name]
    cloth = compile_fabric(fabric, precision=np.float64)
    shadow = compile_shadow(fabric, precision=np.float64)
    uv, wi = seen(fabric, 1)
    together, alone = np.zeros((2, len(uv)))
    lit_all(np.float64, cloth, shadow, True, uv, wi, together)
    one_by_one(np.float64, cloth, shadow, uv, wi, alone)
    assert np.allclose(together, alone, rtol=1e-9, atol=1e-9)
    # A shadow whose mean is taken from somewhere else is far from these.
    assert np.count_nonzero(np.abs(alone - 1) > 0.1) > len(uv) / 20


@njit(**{**KERNEL, "cache": False})
def looked_up(R, cloth, shadow, uv, ints, reals):  # type: ignore[no-untyped-def]
    look_up_block(R, cloth, shadow, uv, 0, uv.shape[0], ints, reals)


@pytest.mark.parametrize("name", FABRICS)
def test_a_block_finds_the_threads_that_its_places_do(name: str) -> None:
    fabric = FABRICS[name]
    cloth = compile_fabric(fabric, precision=np.float64)
    shadow = compile_shadow(fabric, precision=np.float64)
    uv = np.random.default_rng(2).uniform(-40.0, 40.0, (BLOCK, 2))
    uv[7, 1] = math.nan
    ints, reals = np.zeros(INT_ROWS * BLOCK, np.int32), np.zeros(REAL_ROWS * BLOCK)
    looked_up(np.float64, cloth, shadow, uv, ints, reals)
    sound = np.arange(BLOCK) != 7
    at = lookup(cloth, uv[sound])
    rows = {row: ints[row : row + BLOCK][sound] for row in (OF_SET, OF_THREAD, PIECE, FREE)}
    met = ~at.gap
    assert (rows[OF_SET] == at.set).all()
    assert (rows[OF_THREAD][met] == at.thread[met]).all()
    pile = cloth.pile[at.thread] != 0
    assert (rows[FREE] == (at.gap | (met & pile))).all()
    assert np.allclose(reals[ANGLE : ANGLE + BLOCK][sound][met], at.angle[met], atol=1e-12)
    count = cloth.curve_start.shape[1]
    starts = [pieces(t.curve).start for t in fabric.thread_list]
    s = reals[S : S + BLOCK][sound]
    expected = [
        thread * count + np.searchsorted(starts[thread], position, side="right") - 1
        for thread, position in zip(rows[OF_THREAD], s, strict=True)
    ]
    assert (rows[PIECE][met] == np.array(expected)[met]).all()
    assert math.isnan(reals[S + 7])
    assert ints[PIECE + 7] == ints[OF_THREAD + 7] * count


def ends_of_pieces(cloth: CompiledFabric, thread: int, count: int) -> np.ndarray:
    """First and last positions on each piece of a curve, in the precision of `cloth`."""
    real = cloth.curve_start.dtype.type
    starts = cloth.curve_start[thread, :count]
    ends = np.append(np.nextafter(starts[1:], real(0)), cloth.last)
    return np.stack((starts, ends), axis=1)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize("short", [1e-2, 1e-4, 3e-6])
def test_no_position_is_numbered_beyond_the_stretches_of_its_piece(
    precision: type[np.floating], short: float
) -> None:
    first = next(iter(SATIN.threads.values()))
    curve = TangentCurve.from_lengths(
        (a * DEGREE for a in (-40, -40, 30, 30, 40)), (0.7, short, 1.1, short)
    )
    fabric = replace(SATIN, threads={"one": replace(first, curve=curve), "two": first})
    fabric = replace(
        fabric, warp=replace(fabric.warp, sequence=(0,)), weft=replace(fabric.weft, sequence=(1,))
    )
    cloth = compile_fabric(fabric, precision=precision)
    shadow = compile_shadow(fabric, "none", precision=precision)
    for thread, kind in enumerate(fabric.thread_list):
        count = len(pieces(kind.curve).start)
        for piece, (start, end) in enumerate(ends_of_pieces(cloth, thread, count)):
            lowest = shadow.piece_first[thread, piece]
            last = lowest + shadow.piece_last[thread, piece]
            for which in (0, 1):
                offset = which * shadow.set_stretches
                low, high = (
                    stretch_of.py_func(precision, cloth, shadow, which, thread, s) - offset
                    for s in (start, end)
                )
                assert low == lowest
                assert high <= last
                # The shortest pieces need not have all their stretches.
                assert high >= last - 1 or end - start < 1e-5
                assert offset + high < 2 * shadow.set_stretches


def test_between_its_bounds_alone_a_stretch_is_partly_lit() -> None:
    shadow: Shadow = compile_shadow(SATIN, precision=np.float64)
    columns, softness = shadow.mean_columns, float(shadow.softness)
    groups = shadow.mean.reshape(-1, columns + 1, shadow.groups)
    bounds = bounds_of(groups, softness)
    assert (bounds.reshape(-1) == shadow.mean_bounds).all()
    generator = np.random.default_rng(3)
    flat = groups.reshape(-1)
    partly = undecided = 0
    for _ in range(4000):
        stretch = int(generator.integers(len(groups)))
        column, c = int(generator.integers(columns)), float(generator.random())
        elevation = float(generator.random()) * 0.5 * math.pi
        begin = (stretch * (columns + 1) + column) * shadow.groups
        level = level_of.py_func(np.float64, math.sin(elevation), softness)
        mean = mean_over.py_func(
            np.float64, flat, shadow.groups, begin, begin + shadow.groups, c, level
        )
        bound = int(bounds[stretch, column * SECTORS // columns])
        at = int(elevation * ELEVATION)
        if at < bound & 0xFFFF:
            assert mean == 0
        elif at >= bound >> 16:
            assert mean == pytest.approx(1, abs=1e-12)
        else:
            undecided += 1
            partly += 0 < mean < 1 - 1e-9
    # Bounds that are too wide would waste the time that they are there to save.
    assert 100 < undecided < 1.5 * partly

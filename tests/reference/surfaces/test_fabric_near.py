"""Blocks of hits at level `weave` find what the scalar kernels find, one hit at a time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numba import njit

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.appearance.weave.lookup import find, find_all, move_along
from fabricusd.appearance.weave.yarn.compiled import compile_yarn
from fabricusd.appearance.weave.yarn.lay import (
    DOUBLE_ROWS,
    IN_CELL,
    INT_ROWS,
    REAL_ROWS,
    TONE,
    lay_block,
    strand,
)
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import BLOCK, KERNEL
from fabricusd.reference.rays.wave import HIT_ROWS, PLACE
from fabricusd.reference.surfaces.fabric_near import (
    Lit,
    Points,
    look_up,
    look_up_uneven,
    shadows_by_horizon,
    shadows_one_by_one,
)
from fabricusd.schema import load
from tests.appearance.presets import PRESETS

R: Any = np.float32
COUNT = 700
"""Hits: two whole blocks and a part of one."""


def found(fabric: Fabric, v_sign: float) -> tuple[Any, Any, Points, Any]:
    """(cloth, shadow, points, hits) of hits at random places, the last two of them not finite."""
    cloth, shadow = compile_fabric(fabric, precision=np.float32), compile_shadow(fabric)
    hits = np.zeros((HIT_ROWS, COUNT), np.float32)
    hits[PLACE : PLACE + 2] = np.random.default_rng(3).uniform(-40, 40, (2, COUNT))
    hits[PLACE, -1], hits[PLACE + 1, -2] = np.nan, np.inf
    real = [np.empty(COUNT, np.float32) for _ in range(5)]
    points = Points(
        np.empty(COUNT, np.uint8), np.empty(COUNT, np.int32), *real, np.empty(0, np.float32)
    )
    look_up(R, cloth, shadow, R(v_sign), hits, 0, points)
    return cloth, shadow, points, hits


@pytest.mark.parametrize("v_sign", [1.0, -1.0])
@pytest.mark.parametrize("name", ["linen_plain", "polyester_satin_charmeuse"])
def test_threads_are_those_of_the_scalar_lookup(name, v_sign):
    fabric = PRESETS[name]
    cloth, _, points, hits = found(fabric, v_sign)
    uv = hits[PLACE : PLACE + 2].T.astype(np.float64) * [1.0, v_sign]
    expected = [np.empty(COUNT, np.uint8), np.empty(COUNT, np.int32)]
    expected += [np.empty(COUNT, np.float32) for _ in range(4)]
    find_all(R, cloth, uv, *expected)
    ours = points.sets, points.threads, points.along, points.across, points.psi0, points.length
    assert (points.sets == GAP).any() == (name == "linen_plain")
    for mine, theirs in zip(ours, expected, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-5, atol=1e-6)
    assert np.isnan(points.along[-2:]).all()


@pytest.mark.parametrize("law", ["masked", "projected"])
def test_shadows_are_those_of_the_scalar_kernels(law):
    fabric = replace(PRESETS["linen_plain"], surface_law=law)
    cloth, shadow, points, hits = found(fabric, 1.0)
    w = np.random.default_rng(5).standard_normal((2, 3, COUNT)).astype(np.float32)
    w[:, 2] *= 0.1
    w /= np.sqrt((w * w).sum(axis=1, keepdims=True))
    w[0, :, 0] = 0.0, 0.0, 1.0
    lits = []
    for kernel in (shadows_by_horizon, shadows_one_by_one):
        lit = Lit(np.empty(COUNT, np.float32), np.empty(COUNT, np.float32))
        kernel(R, cloth, shadow, R(1), hits, 0, (w[0], w[1]), points, lit)
        lits.append(lit)
    for turn in range(2):
        np.testing.assert_allclose(lits[0][turn], lits[1][turn], rtol=2e-5, atol=2e-6)
        assert (lits[0][turn][:-2][w[turn, 2, :-2] <= 0] == 1).all()
    assert (np.abs(lits[0].light[:-2] - 1) > 0.02).mean() > 0.1


@njit(**{**KERNEL, "cache": False})
def uneven_one_by_one(R, cloth, yarn, home, v_sign, u, v, which_laid, found):  # type: ignore[no-untyped-def]
    """`look_up_uneven` with `find` at each hit; found : (10, n) set to psi0, length, strand, shade
    and the two of PLACE, as `Points` has them."""
    doubles, reals, ints = which_laid
    for k in range(u.size):
        one = slice(k, k + 1)
        at_u, at_v = u[one] + float(home[0]), v[one] + float(home[1])
        lay_block(R, yarn, at_u, at_v, np.zeros(1, R), 1, doubles, reals, ints)
        place_u = float(ints[WARP * BLOCK]) + float(reals[IN_CELL + WARP * BLOCK])
        place_v = float(ints[WEFT * BLOCK]) + float(reals[IN_CELL + WEFT * BLOCK])
        near_u, near_v = place_u - home[0], place_v - home[1]
        which, thread, s, w, angle, run = find(R, cloth, near_u, v_sign * near_v)
        number, across = ints[which * BLOCK] if which != GAP else 0, w
        shade = reals[TONE + which * BLOCK] if which != GAP else R(1)
        if which != GAP and yarn.plies != 0:
            at = v_sign * at_v[0] if which == WARP else at_u[0]
            across = strand(R, yarn, which, thread, number, w, at * yarn.cell[which])
        if which != GAP and run > R(0):
            place = v_sign * place_v if which == WARP else place_u
            moved, s, angle = move_along(R, cloth, yarn, which, thread, number, s, run, place)
            near_u = near_u if which == WARP else moved - home[0]
            near_v = v_sign * moved - home[1] if which == WARP else near_v
        found[0, k], found[1, k], found[2, k], found[3, k] = which, thread, s, w
        found[4, k], found[5, k], found[6, k], found[7, k] = angle, run, across, shade
        found[8, k], found[9, k] = near_u, near_v


@pytest.mark.parametrize("v_sign", [1.0, -1.0])
@pytest.mark.parametrize("name", ["denim", "oxford", "gauze"])
def test_uneven_threads_are_those_of_the_scalar_lookup(name, v_sign):
    fabric = load(name)
    cloth, shadow = compile_fabric(fabric, precision=R), compile_shadow(fabric)
    yarn = compile_yarn(fabric, precision=R)
    hits = np.zeros((HIT_ROWS, COUNT), np.float32)
    hits[PLACE : PLACE + 2] = np.random.default_rng(3).uniform(-40, 40, (2, COUNT))
    u, v = hits[PLACE : PLACE + 2].astype(np.float64)
    home = np.array([[0, 0], [10000, -3000]], np.int64)
    triangles = np.ones(COUNT, np.int32)
    points = Points(
        np.empty(COUNT, np.uint8), np.empty(COUNT, np.int32),
        *(np.empty(COUNT, np.float32) for _ in range(6)),
    )  # fmt: skip
    look_up_uneven(R, cloth, shadow, yarn, home, R(v_sign), triangles, hits, 0, points)
    rooms = (
        np.empty(DOUBLE_ROWS * BLOCK), np.empty(REAL_ROWS * BLOCK, R),
        np.empty(INT_ROWS * BLOCK, np.int32),
    )  # fmt: skip
    expected = np.empty((10, COUNT))
    uneven_one_by_one(R, cloth, yarn, home[1], R(v_sign), u, v, rooms, expected)
    assert (points.sets == expected[0]).all()
    assert (points.threads == expected[1]).all()
    for mine, theirs in zip(points[2:], expected[2:8], strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(hits[PLACE], expected[8], atol=1e-4)
    np.testing.assert_allclose(hits[PLACE + 1], expected[9], atol=1e-4)
    # The cloth is uneven: threads differ in colour, and lie elsewhere than the even ones.
    assert np.abs(points.shade - 1).max() > 0.002
    assert np.abs(hits[PLACE] - u).max() > 0.01

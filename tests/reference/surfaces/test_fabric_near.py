"""Blocks of hits at level `weave` find what the scalar kernels find, one hit at a time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.appearance.weave.lookup import find_all
from fabricusd.fabric import Fabric
from fabricusd.reference.rays.wave import HIT_ROWS, PLACE
from fabricusd.reference.surfaces.fabric_near import (
    Lit,
    Points,
    look_up,
    shadows_by_horizon,
    shadows_one_by_one,
)
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

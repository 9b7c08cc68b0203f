"""The vectorised form of the conserving law gives the values of the scalar one."""

import numpy as np
import pytest
from appearance.presets import often, with_model

from fabricusd.appearance.conserving import blocks
from fabricusd.appearance.conserving.levels import conserving_level_value
from fabricusd.appearance.conserving.multiple import conserving_tables, conserving_value
from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.appearance.weave.lookup import find_all
from fabricusd.appearance.weave.place import Place, Places
from fabricusd.schema import load

CLOTHS = {
    **{name: with_model(load(name), "conserving") for name in ("linen_plain", "velvet")},
    "denim": load("denim"),
}
TOLERANCE = {np.float64: 1e-12, np.float32: 5e-5}
COUNT = 700
"""More than two blocks, and not a multiple of one."""


def _directions(seed, precision):
    w = np.random.default_rng(seed).normal(size=(3, COUNT))
    w /= np.linalg.norm(w, axis=0)
    w[:, :3] = np.eye(3)
    w[:, 3] = 0.0, 0.0, -1.0
    return np.ascontiguousarray(w, precision)


@pytest.mark.parametrize("precision", TOLERANCE)
@pytest.mark.parametrize("name", often(CLOTHS))
def test_at_level_far(name, precision):
    tables = conserving_tables(CLOTHS[name], precision=precision)
    wi, wo = _directions(1, precision), _directions(2, precision)
    out = np.full_like(wi, np.nan)
    blocks.conserving_far_values(precision, tables, wi, wo, out, 0, COUNT)
    for k in range(COUNT):
        value = conserving_value(precision, tables, *wi[:, k], *wo[:, k])
        assert out[:, k] == pytest.approx(value, rel=TOLERANCE[precision], abs=1e-7)


@pytest.mark.parametrize("across_too", [False, True], ids=["weave", "thread"])
@pytest.mark.parametrize("name", often(CLOTHS))
def test_at_a_point(name, across_too):
    R = np.float64
    fabric = CLOTHS[name]
    tables, cloth = conserving_tables(fabric), compile_fabric(fabric)
    wi, wo = _directions(3, R), _directions(4, R)
    uv = np.random.default_rng(5).uniform(0, 50, (COUNT, 2))
    sets, threads = np.empty(COUNT, np.uint8), np.empty(COUNT, np.int32)
    along, across, psi0, length = (np.empty(COUNT) for _ in range(4))
    find_all(R, cloth, uv, sets, threads, along, across, psi0, length)
    shade = np.random.default_rng(6).uniform(0.8, 1.2, COUNT)
    places = Places(sets, threads, psi0, across, shade)
    out = np.full_like(wi, np.nan)
    blocks.conserving_point_values(R, tables, across_too, places, wi, wo, out, 0, COUNT)
    want = np.empty_like(out)
    for k in range(COUNT):
        place = Place(int(sets[k]), int(threads[k]), psi0[k], across[k], shade[k])
        want[:, k] = conserving_level_value(R, tables, across_too, place, *wi[:, k], *wo[:, k])
    assert out == pytest.approx(want, rel=1e-11, abs=1e-13)
    if name == "linen_plain":
        # Its gaps close towards grazing light, so that places in gaps scatter some of it.
        assert want[:, sets > 1].max() > 0

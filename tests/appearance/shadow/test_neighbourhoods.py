"""Horizon tables of large repeats, which have an entry for each neighbourhood."""

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance.shadow import horizon
from fabricusd.appearance.shadow.kinds import METHODS
from fabricusd.appearance.shadow.methods import compile_shadow, shadowing
from fabricusd.appearance.shadow.neighbourhoods import neighbourhoods
from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.bake.texels.recipe import recipe, repeat_mean
from fabricusd.fabric import Fabric, TangentCurve, Thread, ThreadSet, Weave
from fabricusd.schema import load

SATIN = np.array([[(5 * i + j) % 8 == 0 for j in range(8)] for i in range(8)])


def figured(size: int):
    """A disc of warp satin in weft satin, `size` threads each way."""
    i, j = np.mgrid[0:size, 0:size] + 0.5 - size / 2
    tiled = np.tile(SATIN, (size // 8, size // 8))
    cells = np.where(np.hypot(i, j) < 0.35 * size, ~tiled, tiled)
    curve = TangentCurve(positions=(0.0, 1.0), angles=(-0.35, 0.35))
    return Fabric(weave=Weave(cells, "figured"), threads={"Yarn": Thread(curve=curve)})


@pytest.fixture(scope="module")
def cloth():
    fabric = figured(48)
    return fabric, compile_fabric(fabric, precision=np.float64)


@pytest.fixture
def by_kind(monkeypatch, tmp_path):
    """Few entries a table, and a cache of its own."""
    monkeypatch.setattr(horizon, "MOST_KINDS", 1200)
    monkeypatch.setenv("FABRICUSD_CACHE_DIR", str(tmp_path))


def test_cells_of_a_kind_have_the_same_weave_around_them(cloth):
    fabric, compiled = cloth
    found = neighbourhoods(fabric, compiled, (48, 48), 800)
    assert 2 <= found.radius < 8
    assert len(found.first) <= 800
    assert found.kinds.max() == len(found.first) - 1
    cells, reach = fabric.weave.cells, found.radius
    seen = {}
    for i, j in np.ndindex(48, 48):
        around = tuple(
            cells[(i + a) % 48, (j + b) % 48]
            for a in range(-reach, reach + 1)
            for b in range(-reach, reach + 1)
            if np.hypot(a, b) < reach + 0.5
        )
        assert seen.setdefault(found.kinds[i, j], around) == around
    for kind, (i, j) in enumerate(found.first):
        assert found.kinds[i, j] == kind
    finer = neighbourhoods(fabric, compiled, (48, 48))
    assert finer.radius > found.radius


def test_a_weave_that_is_all_chance_still_has_few_kinds():
    cells = np.random.default_rng(1).random((160, 160)) < 0.5
    fabric = replace(load("silk_crepe_de_chine"), weave=Weave(cells, "chance"))
    compiled = compile_fabric(fabric, precision=np.float64)
    for most in (8, 100, 800):
        found = neighbourhoods(fabric, compiled, (160, 160), most)
        assert len(found.first) <= most
        assert np.array_equal(cells[tuple(found.first.T)][found.kinds], cells)


def test_a_repeat_narrower_than_the_radius_wraps_around():
    cells = np.tile(SATIN[:, :1], (500, 1))
    fabric = replace(figured(8), weave=Weave(cells, "narrow"))
    compiled = compile_fabric(fabric, precision=np.float64)
    narrow = neighbourhoods(fabric, compiled, (4000, 1), 100)
    assert (narrow.radius, len(narrow.first)) == (8, 8)
    assert np.array_equal(narrow.kinds[:, 0], np.arange(4000) % 8)


def test_threads_of_many_shapes_have_kinds_of_their_own():
    plain = figured(8).threads["Yarn"]
    threads = {f"T{k}": replace(plain, thickness=1e-4 + 1e-6 * k) for k in range(12)}
    order = tuple(range(12))
    fabric = Fabric(
        weave=Weave(np.eye(2, dtype=bool), "plain"), threads=threads,
        warp=ThreadSet(sequence=order), weft=ThreadSet(sequence=order),
    )  # fmt: skip
    compiled = compile_fabric(fabric, precision=np.float64)
    found = neighbourhoods(fabric, compiled, (12, 12), 20)
    assert len(found.first) == 144


@pytest.mark.exhaustive
def test_shadows_by_neighbourhood_are_near_those_by_cell(cloth, by_kind, monkeypatch):
    fabric, compiled = cloth
    few = compile_shadow(fabric, precision=np.float64)
    assert METHODS[few.method] == "horizon"
    assert few.table.shape[:2] == (1, few.kinds.max() + 1)
    monkeypatch.setattr(horizon, "MOST_KINDS", 6144)
    whole = compile_shadow(fabric, precision=np.float64)
    assert whole.table.shape[:2] == (48, 48)
    assert whole.kinds.size == 0
    rng = np.random.default_rng(2)
    z = np.sin(np.radians(rng.choice([8, 15, 30], 4000)))
    turn = rng.uniform(0, 2 * np.pi, 4000)
    wi = np.stack((np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z), 1)
    uv = rng.uniform(0, 48, (4000, 2))
    g, exact = (shadowing(fabric, wi, uv, compiled=(compiled, s)) for s in (few, whole))
    assert 0.2 < exact.mean() < 0.8
    # Measured .059 and .0056; the table by cell is itself .2 off the march.
    assert np.sqrt(np.mean((g - exact) ** 2)) < 0.08
    assert g.mean() == pytest.approx(exact.mean(), abs=0.008)


def test_a_table_is_kept_and_a_damaged_one_made_again(cloth, by_kind, monkeypatch, tmp_path):
    fabric, _ = cloth
    made = compile_shadow(fabric).table
    fill, times = horizon._fill, []
    monkeypatch.setattr(horizon, "_fill", lambda *a: (times.append(1), fill(*a)))
    assert np.array_equal(compile_shadow(fabric).table, made)
    assert times == []
    (file,) = tmp_path.glob("horizons/*/array.npy")
    file.write_bytes(file.read_bytes()[:1000])
    assert np.array_equal(compile_shadow(fabric).table, made)
    assert times
    times.clear()
    thicker = replace(fabric, warp=replace(fabric.warp, density=1.1 * fabric.warp.density))
    compile_shadow(thicker)
    assert times


def test_a_bake_reads_the_same_horizons(cloth, by_kind):
    fabric, _ = cloth
    made = recipe(fabric)
    assert made.kinds.shape == (48, 48)
    dense = made.table[0][made.kinds]
    same = made._replace(table=dense, kinds=horizon.NO_KINDS)
    assert np.array_equal(repeat_mean(fabric, made), repeat_mean(fabric, same))

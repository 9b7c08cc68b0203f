"""A fabric as arrays: layout, precision, run tables, a grid of 16 million cells."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from fabricusd.appearance.weave.compiled import compile_fabric, true_repeat
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric, ThreadSet, Weave
from tests.appearance.presets import PLAIN, PRESETS
from tests.appearance.weave.slow_weave import slow_lookup
from tests.strategies import fabrics


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_arrays_are_contiguous_and_of_the_precision_asked_for(precision) -> None:  # type: ignore[no-untyped-def]
    cloth = compile_fabric(PRESETS["silk_crepe_de_chine"], precision=precision)
    for name, value in cloth._asdict().items():
        if isinstance(value, np.ndarray):
            assert value.flags.c_contiguous, name
            if np.issubdtype(value.dtype, np.floating):
                assert value.dtype == precision, name
        elif isinstance(value, np.floating):
            assert type(value) is precision, name


@given(fabrics(back=False))
def test_runs_are_where_cells_are_equal_along_the_thread(fabric: Fabric) -> None:
    cells = fabric.weave.cells
    cloth = compile_fabric(fabric)
    m, n = cells.shape
    for slot in range(cloth.runs.shape[2]):
        place, length = cloth.runs[:, :, slot, 0].astype(int), cloth.runs[:, :, slot, 1].astype(int)
        for i in range(m):
            for j in range(n):
                step = (0, 1) if cells[i, j] == (slot == 0) else (1, 0)
                period = n if step == (0, 1) else m
                if length[i, j] == 0:
                    line = cells[i, :] if step == (0, 1) else cells[:, j]
                    assert (line == cells[i, j]).all()
                    assert place[i, j] == (j if step == (0, 1) else i)
                    continue
                assert place[i, j] < length[i, j]
                inside = [
                    cells[(i + step[0] * k) % m, (j + step[1] * k) % n]
                    for k in range(-place[i, j], length[i, j] - place[i, j])
                ]
                assert all(x == cells[i, j] for x in inside)
                assert length[i, j] < period
                for k in (-place[i, j] - 1, length[i, j] - place[i, j]):
                    assert cells[(i + step[0] * k) % m, (j + step[1] * k) % n] != cells[i, j]


def test_the_true_repeat_is_that_of_grid_and_sequences() -> None:
    fabric = Fabric(
        weave=PLAIN,
        threads=PRESETS["silk_shot"].threads,
        warp=ThreadSet(sequence=(0, 1, 1)),
        weft=ThreadSet(sequence=(0, 0, 0, 1)),
    )
    assert true_repeat(fabric) == (6, 4)


@pytest.fixture(scope="module")
def vast() -> Fabric:
    cells = np.random.default_rng(5).random((4096, 4096)) < 0.5
    cells[17] = True  # an end without end on top
    cells[:, 40] = False
    return replace(PRESETS["silk_shot"], weave=Weave(cells, "vast"))


@pytest.mark.exhaustive
def test_a_grid_of_sixteen_million_cells_compiles_compactly(vast: Fabric) -> None:
    compile_fabric(PRESETS["silk_shot"])
    tracemalloc.start()
    cloth = compile_fabric(vast)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    held = sum(x.nbytes for x in cloth if isinstance(x, np.ndarray))
    assert held <= 9.01 * 4096**2  # one byte of grid, and four of runs per visible set
    assert peak <= 20 * 4096**2
    uv = np.random.default_rng(6).uniform(-1e4, 1e4, (200, 2))
    uv[:20, 0] = 17.5
    uv[20:40, 1] = 40.5
    hit = lookup(compile_fabric(vast, precision=np.float64), uv)
    for k, (u, v) in enumerate(uv):
        slow = slow_lookup(vast, u, v)
        if slow.edge > 1e-9:
            assert (hit.set[k], hit.thread[k]) == (slow.set, slow.thread)
            assert hit.position[k] == pytest.approx(slow.position, abs=1e-9)


def test_a_run_beyond_sixteen_bits_is_counted_in_full() -> None:
    cells = np.zeros((1, 70000), bool)
    cells[0, 1:] = True
    fabric = Fabric(weave=Weave(cells), warp=ThreadSet(coverage=0.9), weft=ThreadSet(coverage=1e-6))
    cloth = compile_fabric(fabric)
    assert cloth.runs.dtype == np.uint32
    assert cloth.runs[0, 69999, 0].tolist() == [69998, 69999]
    # The weft crosses one end, over and over: a run without end.
    assert cloth.runs[0, 0, 0].tolist() == [0, 0]


def test_only_a_thread_seen_underneath_takes_a_second_slot() -> None:
    for fabric in PRESETS.values():
        slots = compile_fabric(fabric).runs.shape[2]
        assert slots == (1 if coverage(fabric).width.min() == 1 else 2)


def test_another_precision_is_refused() -> None:
    with pytest.raises(FabricError, match="it must be float32 or float64"):
        compile_fabric(PRESETS["linen_plain"], precision=np.float16)

"""Speed of finding the weave under a point, its shadow, and level `weave`.

    python bench/model/bench_weave.py

Everything runs in one process on the same places and directions, so that the ratios to plain NumPy
hold on a busy machine. Each figure is the best of several runs. The cloth is a satin of five picks
in which the lower set shows, with a curve of five pieces; weave coordinates reach 10^4 threads. The
NumPy side does less: it evaluates the thread's BSDF without masking and `Q`.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numba
import numpy as np
from bench_thread import microcylinder_in_numpy
from numba import njit, prange

from fabricusd.appearance.frame import WARP
from fabricusd.appearance.law import surface_law
from fabricusd.appearance.published.levels import POINT_ROWS, point_block
from fabricusd.appearance.shadow.kinds import Shadow
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.shadow.place_blocks import (
    ANGLE,
    INT_ROWS,
    OF_SET,
    OF_THREAD,
    REAL_ROWS,
    S,
    look_up_block,
)
from fabricusd.appearance.surface import evaluate, points_all, weave_all
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.appearance.weave.lookup import find_all, lookup
from fabricusd.appearance.weave.place import Places
from fabricusd.fabric import DEGREE, Fabric, TangentCurve, Thread, ThreadSet, Weave
from fabricusd.kernels.real import BLOCK, KERNEL

Array = np.ndarray

CHUNK = 32 * BLOCK
"""Places that a worker takes at a time, as in `surface`."""


def satin() -> Fabric:
    """Nearly the published satin, with gaps through which the lower set shows."""
    i, j = np.indices((5, 5))
    angles = (-32, -32, -18, 0, 0, 18, 32, 32)
    flat = TangentCurve.from_lengths(
        (a * DEGREE for a in angles), (1.33, 0.66, 2, 2, 2, 0.66, 1.33)
    )
    common = {"ior": 1.539, "thickness": 1e-4}
    return Fabric(
        threads={
            "flat": Thread(
                albedo=(0.035, 0.013, 0.01),
                isotropic=0.1,
                gamma_surface=2.5 * DEGREE,
                gamma_volume=5 * DEGREE,
                curve=flat,
                **common,
            ),
            "twisted": Thread(
                albedo=(0.2, 0.07, 0.06),
                isotropic=0.7,
                gamma_surface=30 * DEGREE,
                gamma_volume=60 * DEGREE,
                **common,
            ),
        },
        weave=Weave((j - 2 * i) % 5 < 4, "satin"),
        warp=ThreadSet(sequence=(0,), density=10000.0, coverage=0.9),
        weft=ThreadSet(sequence=(1,), density=4000.0, coverage=0.1),
    )


def lookup_in_numpy(cloth: CompiledFabric, uv: Array) -> dict[str, Array]:
    """The lookup, written in NumPy in the precision of `cloth`."""
    cell = np.floor(uv)
    xy = (uv - cell).astype(cloth.width.dtype)
    i, j = np.mod(cell, cloth.grid.shape).astype(np.int32).T
    top = cloth.grid[i, j].astype(np.int32)
    over, along = (np.where(top == WARP, xy[:, a], xy[:, 1 - a]) for a in (0, 1))
    width, other = cloth.width[top], cloth.width[1 - top]
    on_top = np.abs(over - 0.5) <= 0.5 * width
    beside = ~on_top & (other > 0) & (np.abs(along - 0.5) <= 0.5 * other)
    strip = np.where(over < 0.5, over, over - width) / np.where(width < 1, 1 - width, 1)
    w = 2 * np.where(on_top, (over - 0.5) / width, (along - 0.5) / other)
    start, cells = runs_in_numpy(cloth, i, j, top, over)
    s = np.where(on_top, start[0] + along, start[1] + over) / np.where(on_top, *cells)
    s = np.clip(s, 0, cloth.last)
    hit = np.where(on_top, top, 1 - top)
    lengths = cloth.sequence_length[hit]
    place = np.mod(np.where(hit == WARP, cell[:, 0], cell[:, 1]), lengths).astype(np.int32)
    thread = cloth.sequence[hit, place]
    piece = (s[:, None] >= cloth.curve_start[thread]).sum(axis=1) - 1
    angle = cloth.curve_angle[thread, piece]
    angle = angle + (s - cloth.curve_start[thread, piece]) * cloth.curve_slope[thread, piece]
    return {
        "set": np.where(on_top | beside, hit, GAP), "thread": thread, "angle": angle,
        "w": np.where(hit == WARP, -w, w), "cell": np.stack((i, j)), "top": top,
        "along": np.where(on_top, along, strip),
        "slot": np.where(on_top, 0, cloth.runs.shape[2] - 1),
    }  # fmt: skip


def runs_in_numpy(
    cloth: CompiledFabric, i: Array, j: Array, top: Array, over: Array
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """((start above, start below), (cells above, cells below)): `upper_run` and `lower_run`."""
    rim, below = cloth.rim[top], cloth.rim[1 - top]
    place, count = (cloth.runs[i, j, 0, k].astype(rim.dtype) for k in (0, 1))
    repeat = np.where(top == WARP, cloth.grid.shape[1], cloth.grid.shape[0])
    upper = np.where(count > 0, place + rim, place), np.where(count > 0, count + 2 * rim, repeat)
    slot, ahead = cloth.runs.shape[2] - 1, over > 0.5
    place, count = (cloth.runs[i, j, slot, k].astype(rim.dtype) for k in (0, 1))
    step = np.where(ahead, 1, -1)
    i_next = (i + np.where(top == WARP, step, 0)) % cloth.grid.shape[0]
    j_next = (j + np.where(top == WARP, 0, step)) % cloth.grid.shape[1]
    beyond = cloth.runs[i_next, j_next, 0, 1].astype(rim.dtype)
    end = (count > 0) & (place == np.where(ahead, count - 1, 0))
    inner = 2 * below * place + np.where(
        count > 0, np.where(ahead, below - 1, -below), np.where(ahead, 2 * below - 1, 0)
    )
    across = np.where(top == WARP, cloth.grid.shape[0], cloth.grid.shape[1])
    strips = 2 * below * np.where(count > 0, count - 1, across)
    start = np.where(end, np.where(ahead, below - 1, beyond + below), inner)
    cells = np.where(end, beyond + 2 * below, np.maximum(strips, cloth.tiny))
    return (upper[0], start), (upper[1], cells)


def horizon_in_numpy(shadow: Shadow, hit: dict[str, Array], wi: Array) -> Array:
    """The lookup in the horizon table, written in NumPy."""
    table = shadow.table
    part = wi[0] / (np.abs(wi[0]) + np.abs(wi[1]))
    turn = np.where(wi[1] >= 0, 1 - part, 3 + part) * (table.shape[4] / 4)
    a = np.minimum(turn.astype(np.int32), table.shape[4] - 1)
    on_top, half = hit["slot"] == 0, table.shape[3] // 2
    behind = ~on_top & (hit["along"] >= 0.5)
    place = np.where(on_top, hit["along"], 2 * hit["along"] - behind)
    count = np.where(on_top, table.shape[3], half)
    x = np.clip(place * count - 0.5, 0, count - 1)
    row = np.minimum(x.astype(np.int32), np.maximum(count - 2, 0))
    p, r = x - row, row + np.where(behind, half, 0)
    i, j = hit["cell"]
    sine = 0
    for dr, da in itertools.product((0, 1), repeat=2):
        weight = np.abs(1 - dr - p) * np.abs(1 - da - (turn - a))
        azimuth = (a + da) % table.shape[4]
        sine = sine + weight * table[i, j, hit["slot"], r + dr, azimuth]
    sine = sine / 255
    flat = np.sqrt(wi[0] ** 2 + wi[1] ** 2)
    t = (wi[2] * np.sqrt(np.maximum(0, 1 - sine * sine)) - flat * sine) / shadow.softness + 0.5
    t = np.clip(t, 0, 1)
    return t * t * (3 - 2 * t)


def all_in_numpy(
    fabric: Fabric, cloth: CompiledFabric, shadow: Shadow, uv: Array, wi: Array, wo: Array
) -> Array:
    hit = lookup_in_numpy(cloth, uv)
    g = horizon_in_numpy(shadow, hit, wi)
    c, s = np.cos(hit["angle"]), np.sin(hit["angle"])
    turned = []
    for x, y, z in (wi, wo):
        warp = hit["set"] == WARP
        along = np.where(warp, y, x)
        turned.append(np.stack((c * along - s * z, np.where(warp, -x, y), s * along + c * z)))
    out = np.zeros_like(wi)
    for k, thread in enumerate(fabric.thread_list):
        on = (hit["thread"] == k) & (hit["set"] != GAP)
        out[:, on] = g[on] * microcylinder_in_numpy(thread, turned[0][:, on], turned[1][:, on])
    return out


@njit(**KERNEL, parallel=True)
def weave_in_light(R, cloth, shadow, tables, uv, wi, wo, out):  # type: ignore[no-untyped-def]
    """`surface.weave_all` without its shadow: every place is looked up, and lit."""
    n = uv.shape[0]
    for chunk in prange((n + CHUNK - 1) // CHUNK):
        ints, reals = np.empty(INT_ROWS * BLOCK, np.int32), np.empty(REAL_ROWS * BLOCK, R)
        block = np.empty(POINT_ROWS * BLOCK, R)
        first, last = chunk * CHUNK, min(n, (chunk + 1) * CHUNK)
        for begin in range(first, last, BLOCK):
            size = min(BLOCK, last - begin)
            look_up_block(R, cloth, shadow, uv, begin, size, ints, reals)
            places = Places(ints[OF_SET:], ints[OF_THREAD:], reals[ANGLE:], reals[S:], reals[:0])
            point_block(R, tables, False, places, 0, wi, wo, out, begin, size, block)


def best(function: Callable[[], Any], repeats: int) -> float:
    """Seconds of the fastest of `repeats` calls, after a first one that compiles."""
    function()
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def upper(generator: np.random.Generator, n: int) -> Array:
    w = generator.standard_normal((3, n), dtype=np.float32)
    w[2] = np.abs(w[2])
    return w / np.sqrt((w * w).sum(axis=0))


def errors(fabric: Fabric, uv: Array) -> None:
    """Print the differences of the float32 lookup from the float64 one."""
    exact = lookup(compile_fabric(fabric, precision=np.float64), uv)
    quick = lookup(compile_fabric(fabric, precision=np.float32), uv)
    same = exact.set == quick.set
    print(f"\nfloat32 against float64 at {len(uv)} places out to 10^4 threads")
    print(f"another thread, within rounding of an edge: {np.count_nonzero(~same)}")
    for name, unit in (("position", "of the run"), ("across", ""), ("angle", "rad")):
        error = np.abs(getattr(exact, name) - getattr(quick, name))[same]
        print(f"{name}: 99.9th percentile {np.quantile(error, 0.999):.1e} {unit}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--places", type=int, default=500_000)
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    n, workers = options.places, min(options.workers, numba.config.NUMBA_NUM_THREADS)
    generator = np.random.default_rng(0)
    uv = generator.uniform(-1e4, 1e4, (n, 2))
    wi, wo = upper(generator, n), upper(generator, n)
    few, m = max(2, options.repeats // 5), n // 4
    real: Any = np.float32
    print(f"{n} places, float32, best of {options.repeats}; M places/s, and times plain NumPy")
    for law in ("masked", "projected", "visible"):
        fabric = replace(satin(), surface_law=law)
        cloth, shadow = compile_fabric(fabric), compile_shadow(fabric)
        tables = surface_law(fabric, precision=np.float32, shadow=shadow).published
        found = lookup(cloth, uv)
        places, out = found.places, np.empty_like(wi)
        room = np.empty(n, np.uint8), np.empty(n, np.int32), *np.empty((4, n), real)

        # What follows is called before the loop goes on.
        def find(cloth=cloth, room=room) -> None:  # type: ignore[no-untyped-def]
            find_all(real, cloth, uv, *room)

        def weave_level(tables=tables, places=places, out=out) -> None:  # type: ignore[no-untyped-def]
            points_all(real, tables, False, places, wi, wo, out)

        def unshadowed(cloth=cloth, shadow=shadow, tables=tables, out=out) -> None:  # type: ignore[no-untyped-def]
            weave_in_light(real, cloth, shadow, tables, uv, wi, wo, out)

        def shadowed(cloth=cloth, shadow=shadow, tables=tables, out=out) -> None:  # type: ignore[no-untyped-def]
            weave_all(real, cloth, shadow, tables, uv, wi, wo, out)

        slow_find = m / best(lambda cloth=cloth: lookup_in_numpy(cloth, uv[:m]), few)
        slow_all = m / best(
            lambda fabric=fabric, cloth=cloth, shadow=shadow: all_in_numpy(
                fabric, cloth, shadow, uv[:m], wi[:, :m], wo[:, :m]
            ),
            few,
        )
        shadowed()
        expected = evaluate(fabric, wi[:, :m].T, wo[:, :m].T, uv[:m], "weave", "horizon").T
        gap = np.abs(out[:, :m] - expected) / (np.abs(expected) + 1e-3)
        print(f"law {law}; float32 against float64: 99.9 % within {np.quantile(gap, 0.999):.1e}")
        print(f"{'NumPy, lookup':52}{slow_find / 1e6:8.1f}{1.0:8.1f}")
        print(f"{'NumPy, lookup + horizon + thread BSDF':52}{slow_all / 1e6:8.1f}{1.0:8.1f}")
        for count in sorted({1, workers}):
            numba.set_num_threads(count)
            rates: list[float] = []
            for label, function, slow in (
                ("lookup, one place at a time", find, slow_find),
                ("level weave at places that are known", weave_level, None),
                ("lookup + level weave", unshadowed, None),
                ("lookup + horizon + level weave", shadowed, slow_all),
            ):
                rates.append(n / best(function, options.repeats))
                times = f"{rates[-1] / slow:8.1f}" if slow else ""
                print(f"{f'{label}, {count} worker(s)':52}{rates[-1] / 1e6:8.1f}{times}")
            known, found_too, all_ = rates[1:]
            print(
                f"with horizon over without, {count} worker(s): {all_ / found_too:.2f} with the "
                f"lookup on both sides, {all_ / known:.2f} of places that are known"
            )
    errors(fabric, uv)
    cells = np.random.default_rng(1).random((4096, 4096)) < 0.5
    vast = replace(fabric, weave=Weave(cells, "vast"))
    seconds = best(lambda: compile_fabric(vast), 3)
    size = sum(x.nbytes for x in compile_fabric(vast) if isinstance(x, np.ndarray))
    print(f"\na grid of 4096 x 4096 compiles in {seconds:.2f} s to {size / 1e6:.0f} MB")


if __name__ == "__main__":
    main()

"""Speed of the surface law, and its accuracy in single precision.

    python bench/model/bench_surface.py

Everything runs in one process on the same directions. Time is processor time of all workers, so the
figures are per worker and hold on a busy machine. The NumPy side is the plain implementation,
`appearance.plain`. The two sides use different nodes on the curves, so ratios compare nodes per
second. Each figure is the best of several runs. `weave + horizon` looks up the place, its shadow in
the table, and the value.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numba
import numpy as np

from fabricusd.appearance import plain
from fabricusd.appearance.accuracy import spread_pairs
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.surface import far_all, points_all, weave_all
from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.appearance.weave.lookup import find_all
from fabricusd.appearance.weave.place import Places
from fabricusd.schema import load

PRESETS = (
    "linen_plain",
    "silk_crepe_de_chine",
    "polyester_satin_charmeuse",
    "silk_shot",
    "velvet",
)
REFERENCE_PAIRS = 4000
REFERENCE_NODES = 8


def best(run: Callable[[], object], repeats: int) -> float:
    """Processor seconds of the fastest of `repeats` runs, after one run that is not counted."""
    run()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return min(times)


def measure(name: str, count: int, repeats: int) -> None:
    """Print the figures of one preset."""
    R = np.float32
    fabric = load(name)
    wi64, wo64 = spread_pairs(count)
    wi, wo = wi64.astype(R), wo64.astype(R)
    out = np.empty_like(wi)
    tables = surface_tables(fabric, precision=R)
    cloth = compile_fabric(fabric, precision=R)
    shadow = compile_shadow(fabric, "horizon", precision=R)
    uv = np.random.default_rng(1).random((count, 2)) * 1e4
    sets, threads = np.empty(count, np.uint8), np.empty(count, np.int32)
    s, w, angle, length = (np.empty(count, R) for _ in range(4))

    def look_up() -> None:
        find_all(R, cloth, uv, sets, threads, s, w, angle, length)

    def weave() -> None:
        points_all(R, tables, False, Places(sets, threads, angle, w), wi, wo, out)

    def weave_and_horizon() -> None:
        weave_all(R, cloth, shadow, tables, uv, wi, wo, out)

    far_time = best(lambda: far_all(R, tables, wi, wo, out), repeats)
    single = out.astype(np.float64)
    look_up()
    weave_time = best(weave, repeats)
    all_time = best(weave_and_horizon, repeats)
    few = slice(0, REFERENCE_PAIRS)
    i, o = wi64.T[few], wo64.T[few]
    numpy_time = best(lambda: plain.far(fabric, i, o, per_segment=REFERENCE_NODES), 1)
    numpy_nodes = sum(
        len(plain.curve_points(t.thread.curve, REFERENCE_NODES)[0]) for t in plain.shares(fabric)
    )
    ours = count * len(tables.nodes) / far_time
    theirs = REFERENCE_PAIRS * numpy_nodes / numpy_time
    double = np.empty_like(wi64)
    far_all(np.float64, surface_tables(fabric), wi64, wo64, double)
    away = (wi64[2] > 0.05) & (wo64[2] > 0.05) & (double[0] > 1e-4 * double[0].mean())
    error = np.abs(single - double)[0, away] / double[0, away]
    print(
        f"{name:26s} nodes {len(tables.nodes):3d}  far {count / far_time / 1e6:6.1f} M/s "
        f"({ours / theirs:5.0f} x NumPy)  weave {count / weave_time / 1e6:6.1f}  "
        f"weave + horizon {count / all_time / 1e6:6.1f}  "
        f"float32 error p99.9 {np.quantile(error, 0.999):.1e}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000, help="pairs of directions")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    numba.set_num_threads(min(options.workers, numba.config.NUMBA_NUM_THREADS))
    print("million evaluations per second and worker, float32")
    for name in PRESETS:
        measure(name, options.count, options.repeats)


if __name__ == "__main__":
    main()

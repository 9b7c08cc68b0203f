"""Speed of level `far` with and without the mean shadow, in one run.

    python bench/model/bench_far.py [--presets NAME ...] [--law LAW ...] [--pairs N] [--repeats N]

Pairs of directions above the cloth, in float32, on one worker: millions a second, the medians of
alternating runs, and the share that is left with the shadow.
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import time
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import laws
from fabricusd.appearance.published.far import far_values
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.schema import load

PRESETS = ("polyester_satin_charmeuse", "linen_plain", "silk_shot", "wool_flannel")
REAL: Any = np.float32


def directions(count: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """(3, count) directions that are even over the half sphere."""
    z, turn = rng.random(count), 2.0 * np.pi * rng.random(count)
    flat = np.sqrt(1.0 - z * z)
    return np.ascontiguousarray(np.stack((flat * np.cos(turn), flat * np.sin(turn), z)), REAL)


def main() -> None:
    """Print a row for each preset."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presets", nargs="+", default=PRESETS)
    parser.add_argument("--pairs", type=int, default=1 << 15)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument(
        "--law", nargs="+", choices=tuple(laws.REGISTRY), help="in place of each preset's own"
    )
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    wi, wo = directions(options.pairs, rng), directions(options.pairs, rng)
    out = np.zeros((3, options.pairs), REAL)
    print("| preset | law | nodes | without shadow | with it | ratio |\n|---|---|---|---|---|---|")
    for name, law in itertools.product(options.presets, options.law or [""]):
        fabric = load(name)
        fabric = replace(fabric, surface_law=law or fabric.surface_law)
        shadow = compile_shadow(fabric, "horizon", precision=np.float64)
        tables: list[Any] = [
            surface_tables(fabric, precision=REAL, shadow=s) for s in (None, shadow)
        ]
        times: list[list[float]] = [[], []]
        for _ in range(options.repeats + 1):
            for one, taken in zip(tables, times, strict=True):
                start = time.perf_counter()
                far_values(REAL, one, wi, wo, out, 0, options.pairs)
                taken.append(time.perf_counter() - start)
        # The first of each compiles.
        open_, held = (options.pairs / statistics.median(t[1:]) / 1e6 for t in times)
        nodes = len(tables[0].nodes)
        first = f"| {name} | {fabric.surface_law} | {nodes}"
        print(f"{first} | {open_:.1f} | {held:.1f} | {held / open_:.2f} |")


if __name__ == "__main__":
    main()

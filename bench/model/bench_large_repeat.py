"""Shadows of large repeats: what a horizon table by neighbourhood costs, and what it misses.

    python bench/model/bench_large_repeat.py [--vast]

For a damask of silk (a rose of warp satin in weft satin of 8): cells of the repeat, the radius of
the neighbourhoods and how many there are, processor seconds to make the table, seconds to read it
back from the cache, and the rms error of g against the march (`traced`) for lights at 15, 30 and
45 degrees, beside that of a table that has an entry for each cell (where one can be made within a
minute). --vast adds a repeat of 4096 x 4096, with the process's largest memory.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from dataclasses import replace

import numpy as np

from fabricusd.appearance.shadow import horizon
from fabricusd.appearance.shadow.methods import compile_shadow, shadowing
from fabricusd.appearance.shadow.neighbourhoods import neighbourhoods
from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.fabric import Fabric, Weave
from fabricusd.schema import load

SIZES = (24, 72, 240, 480)
WHOLE = 72 * 72
"""Cells up to which a table with an entry for each is made too."""
PLACES = 20000


def rose(size: int) -> Fabric:
    """A damask of `size` ends and picks: roses of 240 threads."""
    i, j = np.mgrid[0:size, 0:size]
    x, y = (np.mod(k, 240) - 120.0 for k in (i, j))
    inside = np.hypot(x, y) < 70 + 30 * np.cos(5 * np.arctan2(y, x))
    satin = (5 * i + j) % 8 == 0
    return replace(load("silk_crepe_de_chine"), weave=Weave(np.where(inside, ~satin, satin)))


def miss(fabric: Fabric, size: int, shadows: list[object]) -> list[float]:
    """Rms error of g by each of `shadows` against the march."""
    rng = np.random.default_rng(0)
    z = np.sin(np.radians(rng.choice([15.0, 30.0, 45.0], PLACES)))
    turn = rng.uniform(0, 2 * np.pi, PLACES)
    flat = np.sqrt(1 - z * z)
    wi = np.stack((flat * np.cos(turn), flat * np.sin(turn), z), 1)
    uv = rng.uniform(0, size, (PLACES, 2))
    cloth = compile_fabric(fabric, precision=np.float64)
    marched = compile_shadow(fabric, "traced", precision=np.float64)
    exact = shadowing(fabric, wi, uv, compiled=(cloth, marched))
    found = [shadowing(fabric, wi, uv, compiled=(cloth, s)) for s in shadows]
    return [float(np.sqrt(np.mean((g - exact) ** 2))) for g in found]


def main() -> None:
    """Print a line for each size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vast", action="store_true", help="also 4096 x 4096")
    options = parser.parse_args()
    compile_shadow(load("silk_shot"), precision=np.float64)
    most = horizon.MOST_KINDS
    for size in (*SIZES, *((4096,) if options.vast else ())):
        fabric = rose(size)
        begun = time.perf_counter()
        cloth = compile_fabric(fabric, precision=np.float64)
        compiled = time.perf_counter() - begun
        around = neighbourhoods(fabric, cloth, (size, size), most // cloth.runs.shape[2])
        with tempfile.TemporaryDirectory() as folder:
            os.environ["FABRICUSD_CACHE_DIR"] = folder
            took = []
            for _ in range(2):
                begun = time.process_time()
                shadow = compile_shadow(fabric, precision=np.float64)
                took.append(time.process_time() - begun)
            shadows = [shadow]
            if shadow.kinds.size and size * size <= WHOLE:
                horizon.MOST_KINDS = 2 * size * size
                shadows.append(compile_shadow(fabric, precision=np.float64))
                horizon.MOST_KINDS = most
        kind = "by cell" if not shadow.kinds.size else f"radius {around.radius}"
        errors = " ".join(f"{x:.3f}" for x in miss(fabric, size, shadows))
        entries = shadow.table.shape[0] * shadow.table.shape[1]
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        print(
            f"{size}: {kind}, {entries} entries, compiled in {compiled:.1f} s, "
            f"table {took[0]:.1f} processor s, again {took[1]:.2f} s, rms {errors}, "
            f"{memory:.2f} GiB",
            flush=True,
        )


if __name__ == "__main__":
    main()

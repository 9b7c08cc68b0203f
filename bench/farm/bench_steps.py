"""Fits and sheets on a local Dask cluster beside threads: time, and sameness to the bit.

    python bench/farm/bench_steps.py [--workers 1 2 4] [--repeat 3]

Prints a table: for this process, and for clusters of so many processes, the wall time of
- fitting a thread to the lobes of a gantry's slice, with intervals, as `fit` does, and one of the
  conserving model, whose tables take longer, once;
- drawing the sheet of all presets, as `preview --presets` does;
- fitting two lobes to each of four fabrics, once, as `material --surface lobes` does,
when kernels and tables are there, and whether the results are the same to the bit.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from fabricusd.appearance.thread import evaluate
from fabricusd.fabric import Fabric
from fabricusd.measure import DESIGNS, Lobes, fit_thread
from fabricusd.preview.fabrics import names_of_presets
from fabricusd.preview.lights import Lights
from fabricusd.preview.sheet import Drawing, tiles_of
from fabricusd.run.cluster import open_cluster
from fabricusd.run.spread import Place, spread
from fabricusd.schema import load

FABRICS = ("linen_plain", "denim", "silk_shot", "wool_flannel")


def views(model: str) -> Lobes:
    """Lobes of spun rayon in the plane, with 2 % noise."""
    theta_i, theta_o, phi_d = DESIGNS["slice"]()
    one = np.ones((len(theta_i), 3))
    made = Lobes(theta_i=theta_i, theta_o=theta_o, phi_d=phi_d, f=one, sigma=one)
    thread = load("thread_rayon_spun").thread_list[0]
    f = evaluate(thread, made.wi, made.wo, model)
    noise = np.random.default_rng(0).standard_normal(f.shape)
    sigma = 0.02 * f + 1e-4
    return Lobes(theta_i=theta_i, theta_o=theta_o, phi_d=phi_d, f=f + sigma * noise, sigma=sigma)


def fitted(model: str, place: Place) -> Any:
    """The fit of a thread."""
    where: Any = {"workers": place} if place is None else {"scheduler": place}
    return fit_thread(views(model), model, **where).as_json()


def sheet(place: Place) -> Any:
    """The tiles of all presets."""
    how = Drawing(shape="cylinder", level=None, size=256, lights=Lights(), samples=None)
    named = [(name, load(name)) for name in names_of_presets()]
    tiles = tiles_of(named, how, lambda picture: picture.codes(), place or 1)
    return [tile.pixels.tobytes() for tile in tiles]


def lobes_of(count: int, fabric: Fabric) -> Any:
    """A mixture that is fitted, and not looked up."""
    from fabricusd.materials.lobes.fit import fit
    from fabricusd.materials.lobes.mixture import CYCLES

    return asdict(fit(fabric, count, CYCLES))


def wardrobe(place: Place) -> Any:
    """The lobes of a few fabrics."""
    return spread("fits", lobes_of, 2, [load(name) for name in FABRICS], place or 1)


STEPS: dict[str, tuple[Callable[[Place], Any], bool]] = {
    "thread": (partial(fitted, "microcylinder"), True),
    "conserving thread": (partial(fitted, "conserving"), False),
    "sheet": (sheet, True),
    "lobes of four fabrics": (wardrobe, False),
}
"""Name -> what is done, and whether it is done first to prepare, and repeated."""


def timed(work: Callable[[Place], Any], place: Place, count: int) -> tuple[float, Any]:
    """(median seconds, the result)."""
    seconds = []
    for _ in range(count):
        begun = time.perf_counter()
        found = work(place)
        seconds.append(time.perf_counter() - begun)
    return statistics.median(seconds), found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--repeat", type=int, default=3)
    given = parser.parse_args()
    base = {}
    print("| step | workers | s | to one process | same |")
    print("|---|---|---|---|---|")
    for name, (work, often) in STEPS.items():
        if often:
            work(None)
        base[name] = timed(work, None, given.repeat if often else 1)
        print(f"| {name} | one process | {base[name][0]:.2f} | 1 | |", flush=True)
    for count in given.workers:
        with open_cluster(f"local:{count}") as cluster:
            for name, (work, often) in STEPS.items():
                if often:
                    work(cluster)
                seconds, found = timed(work, cluster, given.repeat if often else 1)
                first, wanted = base[name]
                same = "yes" if found == wanted else "NO"
                print(
                    f"| {name} | {count} | {seconds:.2f} | {seconds / first:.2f} | {same} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()

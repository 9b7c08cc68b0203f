"""Cloth on three cylinders, two fitted and one predicted: delta E, errors of the fit, seconds.

    python bench/measure/bench_cylinder.py [--fabric linen_plain ...] [--noise 0.01] [--seeds 1]
    python bench/measure/bench_cylinder.py --neighbours

The path tracer photographs wraps of warp upright, warp around and bias under one distant light,
without light from cylinder to cylinder; noise of 1 % and .3 % of the brightest is put on the
profiles that are fitted, anew for each of `--seeds`. Lobes, colours and the scales of the curves
are fitted to the first two; weave, coverage and light are known. Printed are the numbers, and which
share of the 95 % intervals holds the truth. `--neighbours` instead photographs a pale cloth on near
cylinders with light between them, and prints what the fit says of it.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import replace

import numpy as np

from fabricusd.fabric import Fabric
from fabricusd.measure.cylinder.fit import Wrapped, fit_cylinders
from fabricusd.measure.cylinder.model import numbers, require_template, worn
from fabricusd.measure.cylinder.profile import FLOOR, RELATIVE, Profile, profile
from fabricusd.measure.cylinder.setup import PREDICT, Stand
from fabricusd.measure.cylinder.simulate import photographed, three_wraps
from fabricusd.measure.fit.parameters import level_formula, volume_level
from fabricusd.measure.fit.result import Estimate
from fabricusd.schema import load

FABRICS = (
    "linen_plain", "silk_crepe_de_chine", "polyester_satin_charmeuse", "silk_shot", "wool_flannel",
)  # fmt: skip
WIDTH, HEIGHT, SPP = 1440, 360, 32


def profiles_of(
    picture: np.ndarray, stand: Stand, noise: float, seed: int = 1
) -> list[Profile]:  # fmt: skip
    rng = np.random.default_rng(seed)
    made = []
    for cylinder in stand.cylinders:
        p = profile(picture, stand, cylinder, 0, "picture")
        if cylinder.use == PREDICT:
            # What is predicted is the picture itself, without noise.
            made.append(p)
            continue
        sigma = noise / RELATIVE * np.sqrt((RELATIVE * p.light) ** 2 + (FLOOR * p.light.max()) ** 2)
        made.append(replace(p, light=p.light + sigma * rng.standard_normal(p.light.shape)))
    return made


def truths(template: Fabric) -> dict[str, float]:
    """Label -> what the fit should find."""
    found = {}
    for number in numbers(template, coverage=False):
        thread = template.thread_list[number.which]
        found[number.label] = (
            1.0 if number.field == "curve" else getattr(thread, number.field) / number.scale
        )
    for k in worn(template):
        name, t = list(template.threads)[k], template.thread_list[k]
        model = template.model_of(t)
        level = volume_level(model, t.gamma_volume, t.isotropic)
        for a, channel in zip(t.albedo, ("red", "green", "blue"), strict=True):
            found[f"{name} A {channel}"] = a
            found[f"{name} {level_formula(model)} {channel}"] = a * level
        found[f"{name} ((eta - 1)/(eta + 1))^2/gs"] = ((t.ior - 1) / (t.ior + 1)) ** 2 / np.degrees(
            t.gamma_surface
        )
    return found


def told(made: Wrapped) -> list[Estimate]:
    return [*made.estimates.values(), *made.products]


def holds(estimate: Estimate, truth: float) -> bool:
    return bool(estimate.low - 1e-9 <= truth <= estimate.high + 1e-9)


def print_fit(name: str, noise: float, seeds: int) -> None:
    fabric = load(name)
    template = require_template(fabric, name)
    stand, truth = three_wraps(), truths(template)
    picture = photographed(fabric, stand, width=WIDTH, height=HEIGHT, spp=SPP)
    missed: Counter[str] = Counter()
    count = 0
    for seed in range(1, seeds + 1):
        begun, busy = time.perf_counter(), time.process_time()
        made = fit_cylinders(template, profiles_of(picture, stand, noise, seed), irradiance=np.pi)
        seconds, busy = time.perf_counter() - begun, time.process_time() - busy
        found = told(made)
        out = [e.label for e in found if not holds(e, truth[e.label])]
        missed.update(out)
        count += len(found)
        bias = next(w for w in made.wraps if w.predicted)
        print(f"{name}, seed {seed}: {seconds:.0f} s, {busy:.0f} s of processors, chi2/n "
              f"{made.chi2:.2f}, predicted wrap delta E {bias.mean:.2f} and {bias.worst:.2f}, "
              f"{len(found) - len(out)} of {len(found)} intervals hold", flush=True)  # fmt: skip
        if seed == 1:
            for line in made.lines():
                print(f"    {line}")
            for e in found:
                at = truth[e.label]
                print(f"    {e.label}: truth {at:.4g}{'' if holds(e, at) else ', outside'}")
    print(f"{name}: {count - missed.total()} of {count} intervals hold the truth, "
          f"{1 - missed.total() / count:.1%}; missed: {dict(missed)}", flush=True)  # fmt: skip


def print_neighbours() -> None:
    fabric = load("linen_plain")
    threads = {k: replace(t, albedo=(0.2, 0.2, 0.2)) for k, t in fabric.threads.items()}
    fabric = replace(fabric, threads=threads)
    template = require_template(fabric, "white linen")
    for distance in (0.24, 0.3, 0.6):
        stand = three_wraps(distance)
        picture = photographed(fabric, stand, width=WIDTH, height=HEIGHT, spp=SPP, bounces=4)
        made = fit_cylinders(template, profiles_of(picture, stand, 0.001), irradiance=np.pi)
        print(f"white linen, radius .11, axes {distance} apart: chi2/n {made.chi2:.2f}")
        for note in made.notes:
            print(f"  note: {note}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fabric", nargs="+", default=FABRICS)
    parser.add_argument("--noise", type=float, default=RELATIVE)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--neighbours", action="store_true")
    options = parser.parse_args()
    if options.neighbours:
        print_neighbours()
        return
    for name in options.fabric:
        print_fit(name, options.noise, options.seeds)


if __name__ == "__main__":
    main()

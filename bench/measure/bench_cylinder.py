"""Cloth on three cylinders, two fitted and one predicted: delta E, errors of the fit, seconds.

    python bench/measure/bench_cylinder.py [--fabric linen_plain ...] [--noise 0.01] [--neighbours]

The path tracer photographs wraps of warp upright, warp around and bias under one distant light,
without light from cylinder to cylinder; noise of 1 % and .3 % of the brightest is put on the
profiles that are fitted. Lobes, colours and the scales of the curves are fitted to the first two;
weave, coverage and light are known. `--neighbours` instead photographs a pale cloth on near
cylinders with light between them, and prints what the fit says of it.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from fabricusd.fabric import Fabric
from fabricusd.measure.cylinder.fit import fit_cylinders
from fabricusd.measure.cylinder.model import numbers, require_template
from fabricusd.measure.cylinder.profile import FLOOR, RELATIVE, Profile, profile
from fabricusd.measure.cylinder.setup import PREDICT, Stand
from fabricusd.measure.cylinder.simulate import photographed, three_wraps
from fabricusd.schema import load

FABRICS = (
    "linen_plain", "silk_crepe_de_chine", "polyester_satin_charmeuse", "silk_shot", "wool_flannel",
)  # fmt: skip


def profiles_of(fabric: Fabric, stand: Stand, noise: float, bounces: int) -> list[Profile]:
    picture = photographed(fabric, stand, bounces=bounces)
    rng = np.random.default_rng(1)
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


def print_fit(name: str, noise: float) -> None:
    fabric = load(name)
    template = require_template(fabric, name)
    profiles = profiles_of(fabric, three_wraps(), noise, 0)
    begun, busy = time.perf_counter(), time.process_time()
    made = fit_cylinders(template, profiles, irradiance=np.pi)
    seconds, busy = time.perf_counter() - begun, time.process_time() - busy
    print(f"{name}: {seconds:.0f} s, {busy:.0f} s of processors, chi2/n {made.chi2:.2f}")
    for wrap in made.wraps:
        how = "predicted" if wrap.predicted else "fitted"
        print(f"  {wrap.name:8} {how:9} delta E {wrap.mean:.3f} mean, {wrap.worst:.3f} p95")
    for number in numbers(template, coverage=False):
        thread = template.thread_list[number.which]
        truth = 1.0 if number.field == "curve" else getattr(thread, number.field) / number.scale
        found = made.estimates[number.label]
        holds = "" if found.low <= truth <= found.high else "  (outside)"
        print(f"  {number.label:20} {found.value:8.4g}  truth {truth:8.4g}{holds}")
    for note in made.notes:
        print(f"  note: {note}")


def print_neighbours() -> None:
    fabric = load("linen_plain")
    threads = {k: replace(t, albedo=(0.2, 0.2, 0.2)) for k, t in fabric.threads.items()}
    fabric = replace(fabric, threads=threads)
    template = require_template(fabric, "white linen")
    for distance in (0.24, 0.3, 0.6):
        stand = three_wraps(distance)
        made = fit_cylinders(template, profiles_of(fabric, stand, 0.001, 4), irradiance=np.pi)
        print(f"white linen, radius .11, axes {distance} apart: chi2/n {made.chi2:.2f}")
        for note in made.notes:
            print(f"  note: {note}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fabric", nargs="+", default=FABRICS)
    parser.add_argument("--noise", type=float, default=RELATIVE)
    parser.add_argument("--neighbours", action="store_true")
    options = parser.parse_args()
    if options.neighbours:
        print_neighbours()
        return
    for name in options.fabric:
        print_fit(name, options.noise)


if __name__ == "__main__":
    main()

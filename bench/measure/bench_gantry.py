"""A known thread through the simulated gantry and back: errors, coverage of intervals, speed.

    python bench/measure/bench_gantry.py [--part views|fits|printed|half|coverage|speed|words ...]
        [--repeats 20]

The seven threads of [Bisker2011] Table 3.1 as presets, with their published numbers. Frames are
48 x 96, exposures .02 to .8 s, two shots of each, a thread 5 pixels wide and defocused by 3.
"""

from __future__ import annotations

import argparse
import math
import resource
import shutil
import tempfile
import time
from pathlib import Path

import numpy as np

from fabricusd.appearance.thread import evaluate
from fabricusd.fabric import Thread
from fabricusd.measure import DESIGNS, Lobes, fit_thread, measure, simulate
from fabricusd.measure.fit.parameters import volume_level
from fabricusd.measure.gantry.camera import Camera
from fabricusd.measure.gantry.simulate import Shoot
from fabricusd.measure.words import COLUMNS, TABLE_3_2, misses, words
from fabricusd.schema import load

MODEL = "microcylinder"
RELATIVE, FLOOR = 0.03, 0.002
"""Noise of lobes that are made without a gantry: a share of the value, and 1/sr."""


def thread_of(name: str) -> Thread:
    return load(f"thread_{name}{{appearance=published}}").thread_list[0]


def through(thread: Thread, bits: int, *, printed: bool = False, seed: int = 0) -> Lobes:
    """Lobes of a slice, photographed and measured."""
    folder = tempfile.mkdtemp(prefix="gantry-")
    try:
        simulate(thread, folder + "/shoot", camera=Camera(bits=bits), seed=seed)
        told = {"hdr": "thesis", "background": "zero"} if printed else {}
        return measure(folder + "/shoot", **told).lobes
    finally:
        shutil.rmtree(folder)


def truth(thread: Thread, lobes: Lobes) -> np.ndarray:
    return evaluate(thread, lobes.wi, lobes.wo, MODEL)


def made(thread: Thread, design: str, seed: int) -> Lobes:
    """Lobes with Gaussian noise, without a gantry."""
    theta_i, theta_o, phi_d = DESIGNS[design]()
    rng = np.random.default_rng(seed)
    one = np.ones((len(theta_i), 3))
    lobes = Lobes(theta_i=theta_i, theta_o=theta_o, phi_d=phi_d, f=one, sigma=one)
    f = truth(thread, lobes)
    sigma = np.sqrt((RELATIVE * f) ** 2 + FLOOR**2)
    noisy = f + sigma * rng.standard_normal(f.shape)
    return Lobes(theta_i=theta_i, theta_o=theta_o, phi_d=phi_d, f=noisy, sigma=sigma)


def errors_of(fit, thread: Thread) -> str:
    """What a fit is off by, in a line."""
    found = fit.thread
    ratio = np.mean(np.array(found.albedo) / np.array(thread.albedo)) - 1
    level = [
        np.mean(t.albedo) * volume_level(MODEL, t.gamma_volume, t.isotropic)
        for t in (found, thread)
    ]
    said = (
        f"eta {found.ior - thread.ior:+.4f}  "
        f"gs {100 * (found.gamma_surface / thread.gamma_surface - 1):+.2f} %  "
        f"gv {math.degrees(found.gamma_volume - thread.gamma_volume):+.2f} deg  "
        f"kd {found.isotropic - thread.isotropic:+.4f}  A {100 * ratio:+.2f} %  "
        f"product {100 * (level[0] / level[1] - 1):+.2f} %  chi2/n {fit.chi2:.2f}"
    )
    return said + ("  [said inseparable]" if any("told apart" in n for n in fit.notes) else "")


def views() -> None:
    print("value of a view: bias, rms, and the share of both that noise explains")
    for bits in (12, 8):
        for name in TABLE_3_2:
            thread = thread_of(name)
            lobes = through(thread, bits)
            f = truth(thread, lobes)
            off = lobes.f / f - 1
            dark = f.mean(axis=1) < np.median(f.mean(axis=1))
            chi2 = float((((lobes.f - f) / lobes.sigma) ** 2).mean())
            whole = lobes.f.sum() / f.sum() - 1
            print(
                f"  {bits:2} bit {name:19} bias {100 * off.mean():+6.2f} %  rms "
                f"{100 * np.sqrt((off**2).mean()):5.2f} %  dark half "
                f"{100 * off[dark].mean():+6.2f} %"
                f"  sum {100 * whole:+6.2f} %  chi2/n {chi2:.2f}",
                flush=True,
            )


def printed() -> None:
    print("the thesis as printed (eq. 3.3 with rejection, background set to zero)")
    for bits in (12, 8):
        for name in TABLE_3_2:
            thread = thread_of(name)
            lobes = through(thread, bits, printed=True)
            off = lobes.f / truth(thread, lobes) - 1
            print(f"  {bits:2} bit {name:19} bias {100 * off.mean():+6.2f} %", flush=True)


def fits() -> None:
    print("end to end: photographs, lobes, thread")
    for bits in (12, 8):
        for name in TABLE_3_2:
            thread = thread_of(name)
            fit = fit_thread(through(thread, bits), MODEL)
            print(f"  {bits:2} bit {name:19} {errors_of(fit, thread)}", flush=True)


def half() -> None:
    print(f"half sphere, all of its views, noise {RELATIVE:.0%} and {FLOOR}/sr")
    for name in TABLE_3_2:
        thread = thread_of(name)
        start = time.perf_counter()
        fit = fit_thread(made(thread, "half", 0), MODEL)
        seconds = time.perf_counter() - start
        print(f"  {name:19} {errors_of(fit, thread)}  {seconds:.1f} s", flush=True)


def coverage(repeats: int) -> None:
    print(f"95 % intervals that hold the truth, {repeats} noisy slices")
    for name in TABLE_3_2:
        thread = thread_of(name)
        held: dict[str, list[bool]] = {}
        for seed in range(repeats):
            fit = fit_thread(made(thread, "slice", seed), MODEL, seed=seed)
            true = {
                "eta": thread.ior, "gs": math.degrees(thread.gamma_surface),
                "gv": math.degrees(thread.gamma_volume), "kd": thread.isotropic,
                **dict(zip(("A red", "A green", "A blue"), thread.albedo, strict=True)),
            }  # fmt: skip
            for key, value in true.items():
                each = fit.estimates[key]
                held.setdefault(key, []).append(bool(each.low <= value <= each.high))
            level = volume_level(MODEL, thread.gamma_volume, thread.isotropic)
            for product, albedo in zip(fit.products, thread.albedo, strict=False):
                held.setdefault("product", []).append(
                    bool(product.low <= albedo * level <= product.high)
                )
        said = "  ".join(f"{key} {100 * np.mean(v):.1f}" for key, v in held.items())
        print(f"  {name:19} {said}", flush=True)


def speed() -> None:
    """Captures of 61 kB from disk, and the memory they take, for two sizes of folder."""
    thread = thread_of("rayon_spun")
    for shots in (2, 6):
        folder = Path(tempfile.mkdtemp(prefix="gantry-"))
        try:
            shoot = Shoot(design="slice", shape=(190, 320), shots=shots)
            count = simulate(thread, folder / "shoot", camera=Camera(bits=8), shoot=shoot)
            size = sum(p.stat().st_size for p in (folder / "shoot").glob("view*")) / count
            start = time.perf_counter()
            found = measure(folder / "shoot")
            seconds = time.perf_counter() - start
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(
                f"  {found.captures} captures of {size / 1e3:.0f} kB in {seconds:.2f} s: "
                f"{found.captures / seconds:.0f} a second; peak memory {peak:.0f} MB",
                flush=True,
            )
        finally:
            shutil.rmtree(folder)


def table() -> None:
    total = 0
    for name, wanted in TABLE_3_2.items():
        found = misses(words(thread_of(name), MODEL), wanted)
        total += len(found)
        print(f"  {name:19} {'; '.join(found) or 'all as in the table'}")
    print(f"  {total} of {2 * len(COLUMNS) * len(TABLE_3_2)} words missed")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    every = ("views", "fits", "printed", "half", "coverage", "speed", "words")
    parser.add_argument("--part", nargs="*", choices=every, default=every)
    parser.add_argument("--repeats", type=int, default=20)
    given = parser.parse_args()
    for part in given.part:
        start = time.perf_counter()
        {
            "views": views, "fits": fits, "printed": printed, "half": half, "speed": speed,
            "coverage": lambda: coverage(given.repeats), "words": table,
        }[part]()  # fmt: skip
        print(f"{part}: {time.perf_counter() - start:.0f} s\n", flush=True)


if __name__ == "__main__":
    main()

"""Speed of the vectorised thread models, compared with plain NumPy.

    python bench/model/bench_thread.py

Everything runs in one process on the same directions, so that the ratios hold on a busy machine.
Each figure is the best of several runs.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numba
import numpy as np

from fabricusd.appearance import plain, thread
from fabricusd.fabric import MODELS, Thread

LINEN = Thread(albedo=(0.06, 0.24, 0.3), ior=1.46, gamma_surface=0.209, gamma_volume=0.419)


def directions(generator: np.random.Generator, n: int) -> np.ndarray:
    w = generator.standard_normal((3, n), dtype=np.float32)
    return w / np.sqrt((w * w).sum(axis=0))


def microcylinder_in_numpy(t: Thread, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """The function, written in NumPy in float32, without computing any angle twice."""
    one = np.float32(1)
    eta, kd = np.float32(t.ior), np.float32(t.isotropic)
    gs, gv = np.float32(t.gamma_surface), np.float32(t.gamma_volume)
    theta_i, theta_o = np.arcsin(wi[0]), np.arcsin(wo[0])
    cos_i, cos_o = np.sqrt(one - wi[0] ** 2), np.sqrt(one - wo[0] ** 2)
    cos_phi = np.clip((wi[1] * wo[1] + wi[2] * wo[2]) / (cos_i * cos_o), -1, 1)
    cos_half = np.sqrt((one + cos_phi) / 2)
    theta_h, cos_d = (theta_i + theta_o) / 2, np.cos((theta_i - theta_o) / 2)
    c = cos_d * cos_half
    inside = np.sqrt(one - (one - c * c) / eta**2)
    r_s, r_p = (c - eta * inside) / (c + eta * inside), (eta * c - inside) / (eta * c + inside)
    reflected = (r_s * r_s + r_p * r_p) / 2
    root = np.float32(np.sqrt(2 * np.pi))
    g_s = np.exp(-((theta_h / gs) ** 2) / 2) / (gs * root)
    g_v = np.exp(-((theta_h / gv) ** 2) / 2) / (gv * root)
    volume = (one - reflected) ** 2 * ((one - kd) * g_v + kd) / np.maximum(cos_i + cos_o, 1e-3)
    albedo = np.array(t.albedo, np.float32)[:, None]
    return (reflected * cos_half * g_s + volume * albedo) / np.maximum(cos_d * cos_d, 1e-6)


def best(run: Callable[[], object], repeats: int) -> float:
    """Seconds of the fastest of `repeats` runs, after one run that is not counted."""
    run()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=1_000_000)
    parser.add_argument("--repeats", type=int, default=60)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    n, workers = options.pairs, min(options.workers, numba.config.NUMBA_NUM_THREADS)
    generator = np.random.default_rng(0)
    wi, wo = directions(generator, n), directions(generator, n)
    out = np.empty_like(wi)
    few = max(3, options.repeats // 6)
    numpy_rate = n / best(lambda: microcylinder_in_numpy(LINEN, wi, wo), few)
    m = n // 10
    i, o = wi[:, :m].T.astype(float), wo[:, :m].T.astype(float)
    plain_rate = {
        model: m / best(lambda model=model: plain.thread_value(LINEN, model, i, o), few)
        for model in MODELS
    }
    print(
        f"{n} pairs, best of {options.repeats}; M evaluations/s; times NumPy's float32 "
        "microcylinder; times the same model in plain float64"
    )
    print(f"{'NumPy float32, microcylinder':44}{numpy_rate / 1e6:8.1f}{1.0:8.1f}")
    for model, rate in plain_rate.items():
        label = f"plain.thread_value, {model}, float64"
        print(f"{label:44}{rate / 1e6:8.1f}{rate / numpy_rate:8.1f}{1.0:8.1f}")
    fastest = 0.0
    for count in sorted({1, workers}):
        numba.set_num_threads(count)
        for model in MODELS:
            for precision in (np.float32, np.float64):
                row = thread.thread_row(LINEN, model).astype(precision)
                a, b, c = (x.astype(precision) for x in (wi, wo, out))
                seconds = best(
                    lambda row=row, a=a, b=b, c=c: thread.evaluate_soa(row, a, b, c),
                    options.repeats,
                )
                rate = n / seconds
                if model == "microcylinder" and precision is np.float32:
                    fastest = max(fastest, rate)
                label = f"{model}, {precision.__name__}, {count} worker(s)"
                ratios = f"{rate / numpy_rate:8.1f}{rate / plain_rate[model]:8.1f}"
                print(f"{label:44}{rate / 1e6:8.1f}{ratios}")
    # A lower bound for any loop over the same memory: read both directions and write the value.
    floor = n / best(lambda: np.add(wi, wo, out=out), options.repeats)
    print(f"{'only reading and writing that memory':44}{floor / 1e6:8.1f}{floor / numpy_rate:8.1f}")
    bound = "memory" if fastest > floor / 2 else "arithmetic"
    print(f"What limits the float32 microcylinder loop here: {bound}.")


if __name__ == "__main__":
    main()

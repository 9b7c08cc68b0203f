"""The passes over a picture: which pixels get how many samples, in which batches.

A batch's paths are traced together, and rounding depends on a path's place in its batch. So the
batches depend on the picture alone, not on who traces them: the workers of this process here, or
those of a cluster (`farm`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.reference.film import Film
from fabricusd.reference.integrator import Tracer
from fabricusd.reference.rays.wave import Wave
from fabricusd.run.workers import Batches, pixels_along_z_curve
from fabricusd.stop import Stop

BATCH = 1 << 13
"""Number of paths in a batch: large enough to amortise the start of a stage, small enough for the
cache."""

PASS = 16
"""Samples per pixel in one pass over the picture; no pixel gets more before all have had these."""

Progress = Callable[[float, float], None]
"""A callback that takes the fraction done, 0 to 1, and the seconds since the start."""


class Spent(NamedTuple):
    """What sampling a picture took.

    counters : (3,) int64 - rays, shadow rays and values that were not finite; lost : throughput of
    the paths that were cut off; seconds : of processor time, all workers together
    """

    counters: NDArray[np.int64]
    lost: float
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """How a picture is sampled.

    most : samples a pixel gets; noise : relative error at which it gets no more, None for never
    """

    width: int
    height: int
    most: int
    noise: float | None = None

    @property
    def batch(self) -> int:
        """Paths of a batch: fewer for a small picture, so that many workers have something to do.

        It does not depend on the number of workers.
        """
        size, pixels = BATCH, self.width * self.height
        while size > 1024 and pixels * min(PASS, self.most) < 16 * size:
            size //= 2
        return size


@dataclass(frozen=True, kw_only=True, eq=False)
class Pass:
    """One pass: `samples` more for each of `pixels`, which have had `done`.

    pixels : (n,) int32, in batches of `per_batch`; share : of the picture's pixels
    """

    pixels: NDArray[np.int32]
    done: int
    samples: int
    per_batch: int
    share: float

    @property
    def batches(self) -> int:
        """Number of batches."""
        return -(-len(self.pixels) // self.per_batch)

    def batch(self, k: int) -> NDArray[np.int32]:
        """The pixels of batch `k`."""
        return self.pixels[k * self.per_batch : (k + 1) * self.per_batch]


def passes(sampling: Sampling, film: Film) -> Iterator[Pass]:
    """The passes over a picture, in order; each must be in `film` before the next is asked for."""
    order = pixels_along_z_curve(sampling.width, sampling.height)
    active, done = order, 0
    while done < sampling.most and len(active):
        samples = min(PASS, sampling.most - done)
        yield Pass(
            pixels=active, done=done, samples=samples,
            per_batch=max(sampling.batch // samples, 1), share=len(active) / len(order),
        )  # fmt: skip
        done += samples
        # A picture of one pass has no halves to compare.
        if done > samples or done < sampling.most:
            film.compare_halves()
        if sampling.noise is not None:
            active = order[film.relative_error()[order] > sampling.noise]


def sample(
    tracer: Tracer,
    lens: Any,
    film: Film,
    sampling: Sampling,
    workers: int,
    progress: Progress | None,
    stop: Stop,
) -> tuple[bool, Spent]:
    """Run all passes on threads of this process; (False, ...) if interrupted."""
    begun, busy = time.perf_counter(), time.process_time()
    waves = [Wave(sampling.batch, aovs=film.extra) for _ in range(workers)]
    counters, lost = np.zeros((workers, 3), np.int64), np.zeros((workers, 1))
    complete = True
    for one in passes(sampling, film):

        def task(worker: int, batch: int, one: Pass = one) -> None:
            pixels, wave = one.batch(batch), waves[worker]
            tracer.trace(
                wave, lens, film.width, pixels, one.done, one.samples, counters[worker],
                lost[worker],
            )  # fmt: skip
            film.add(pixels, one.samples, wave.film)

        def report(batches: int, one: Pass = one) -> None:
            if progress is not None:
                part = batches / max(one.batches, 1)
                progress(share_done(sampling, one, part), time.perf_counter() - begun)

        complete = Batches(workers, task, stop).run(one.batches, report)
        if not complete:
            break
    spent = Spent(counters.sum(axis=0), float(lost.sum()), time.process_time() - busy)
    return complete, spent


def share_done(sampling: Sampling, one: Pass, part: float) -> float:
    """The fraction of a picture that is done when `part` of a pass is."""
    if sampling.noise is not None:
        return 1 - one.share
    return min((one.done + one.samples * part) / sampling.most, 1.0)

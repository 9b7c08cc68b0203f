"""Pictures on the workers of a cluster.

A part is a run of whole batches of a pass (`passes`), so a picture is the same to the bit as on one
machine with processors of the same kind. A job returns the sums of its pixels after each pass, 48
bytes a pixel, or 112 with layers of surfaces.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.reference.film import Film, FilmPart
from fabricusd.reference.integrator import Tracer
from fabricusd.reference.passes import Pass, Progress, Sampling, Spent, passes, share_done
from fabricusd.reference.rays.camera import build_lens
from fabricusd.reference.rays.wave import BEAUTY_ROWS, FILM_ROWS, Wave
from fabricusd.run.cluster import Cluster, Kept
from fabricusd.scene.scene import Camera, Scene
from fabricusd.stop import Stop

JOBS_PER_THREAD = 4
"""Jobs of a round for each thread of the cluster, so that all end at about the same time."""
HELD = 1 << 28
"""Bytes of sums that one round may bring back."""
MOST_PASSES = 8
"""Most passes of a job: what a lost worker loses."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """All that a worker needs to trace parts of one picture.

    settings : the keyword arguments of `Tracer`
    """

    scene: Scene
    camera: Camera
    settings: dict[str, Any]
    sampling: Sampling
    pixel_filter: str
    layers: bool


class Part(NamedTuple):
    """A job: `passes` passes, the first of which is `first`, over the pixels of some batches.

    before : the sums of the pixels; None for zeros
    """

    first: Pass
    passes: int
    before: FilmPart | None


class Traced(NamedTuple):
    """What comes back: the sums after each pass, what `Tracer.trace` counted, and the time taken.

    seconds : of one processor
    """

    after: list[FilmPart]
    counters: NDArray[np.int64]
    lost: float
    seconds: float


def sample_on(
    cluster: Cluster, picture: Picture, film: Film, progress: Progress | None, stop: Stop
) -> tuple[bool, Spent]:
    """Run all passes over `picture` on a cluster, into `film`; (False, ...) if interrupted."""
    begun, sampling = time.perf_counter(), picture.sampling
    counters, lost, seconds = np.zeros(3, np.int64), 0.0, 0.0
    coming = passes(sampling, film)
    complete = True
    for one in coming:
        count = _passes_at_once(sampling, film, one)
        pieces = _pieces(one, JOBS_PER_THREAD * cluster.threads)
        jobs = [
            Part(piece, count, film.take(piece.pixels) if one.done else None) for piece in pieces
        ]
        found: dict[int, Traced] = {}

        def done(k: int, traced: Traced, found: Any = found, one: Pass = one, jobs: Any = jobs,
                 count: int = count) -> None:  # fmt: skip
            found[k] = traced
            if progress is not None:
                part = count * len(found) / len(jobs)
                progress(share_done(sampling, one, part), time.perf_counter() - begun)

        complete = cluster.run(trace_part, picture, jobs, done, stop)
        for traced in found.values():
            counters += traced.counters
            lost, seconds = lost + traced.lost, seconds + traced.seconds
        if not complete:
            for k, traced in found.items():
                film.put(pieces[k].pixels, traced.after[-1])
            break
        for number in range(count):
            if number:
                # The film holds the pass before: what follows from it is computed here.
                next(coming)
            for k, traced in found.items():
                film.put(pieces[k].pixels, traced.after[number])
    return complete, Spent(counters, lost, seconds)


def _passes_at_once(sampling: Sampling, film: Film, one: Pass) -> int:
    """How many passes a job may run: one where the next depends on the whole picture's noise."""
    if sampling.noise is not None:
        return 1
    equal = (sampling.most - one.done) // one.samples
    held = len(one.pixels) * 4 * (len(film.sums) + 5)
    return int(max(min(equal, HELD // held, MOST_PASSES), 1))


def _pieces(one: Pass, count: int) -> list[Pass]:
    """A pass over the whole picture, cut into at most `count` passes over whole batches."""
    per = -(-one.batches // min(count, one.batches)) * one.per_batch
    return [
        replace(one, pixels=one.pixels[start : start + per])
        for start in range(0, len(one.pixels), per)
    ]


def trace_part(kept: Kept, part: Part) -> Traced:
    """Trace a part of a picture; runs on a worker."""
    picture: Picture = kept.thing
    with kept.lock:
        if "tracer" not in kept.built:
            kept.built["tracer"] = _prepared(picture)
    tracer, lens = kept.built["tracer"]
    wave = _wave(kept, picture)
    begun, one = time.thread_time(), part.first
    counters, lost = np.zeros(3, np.int64), np.zeros(1)
    sums = _zeros(len(one.pixels), picture.layers) if part.before is None else part.before.copy()
    after = []
    for number in range(part.passes):
        first = one.done + number * one.samples
        for k in range(one.batches):
            pixels = one.batch(k)
            tracer.trace(
                wave, lens, picture.sampling.width, pixels, first, one.samples, counters, lost
            )
            start = k * one.per_batch
            places = np.arange(start, start + len(pixels), dtype=np.int32)
            sums.add(places, one.samples, wave.film)
        after.append(sums.copy())
    return Traced(after, counters, float(lost[0]), time.thread_time() - begun)


def _prepared(picture: Picture) -> tuple[Tracer, Any]:
    tracer = Tracer(picture.scene, **picture.settings)
    width, height = picture.sampling.width, picture.sampling.height
    lens = build_lens(picture.camera, width, height, tracer.tables.centre, picture.pixel_filter)
    tracer.aim(lens, width, height)
    return tracer, lens


def _wave(kept: Kept, picture: Picture) -> Wave:
    """The buffers of the calling thread."""
    key = ("wave", threading.get_ident())
    if key not in kept.built:
        kept.built[key] = Wave(picture.sampling.batch, aovs=picture.layers)
    found: Wave = kept.built[key]
    return found


def _zeros(pixels: int, layers: bool) -> FilmPart:
    rows = FILM_ROWS if layers else BEAUTY_ROWS
    return FilmPart(
        np.zeros((rows, pixels), np.float32), np.zeros((3, pixels), np.float32),
        np.zeros(pixels, np.int32), np.zeros(pixels, np.int32),
    )  # fmt: skip

"""The frames of every view summed, on every core; what is done is kept, so a run can go on."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import fabricusd.images.raw
from fabricusd.cache import kept
from fabricusd.errors import FabricError
from fabricusd.measure.capture.calibrate import MOST_LOST, Calibration
from fabricusd.measure.capture.frames import Frame, read_frame
from fabricusd.measure.capture.manifest import Manifest, Shot, by_exposure
from fabricusd.measure.capture.merge import Merged, merge
from fabricusd.measure.capture.reflectance import thread_sum
from fabricusd.measure.progress import told
from fabricusd.run.workers import Batches, worker_count

Floats = NDArray[np.float64]

CHUNK = 256
"""Views whose sums are kept together: some 2000 frames, a few seconds."""


def view_sums(
    manifest: Manifest, calibration: Calibration, views: list[list[Shot]], background: str,
    workers: int | None,
) -> tuple[Floats, dict[int, str]]:  # fmt: skip
    """((n, 2, 3) H summed by two halves of each view's shots, index -> why a view cannot be used).

    Sums are kept in the cache, CHUNK views at a time. A later run on the same frames, told by their
    names, sizes and times of change, takes them from there.
    """
    values = np.full((len(views), 2, 3), np.nan)
    problems: dict[int, str] = {}

    def one(k: int) -> None:
        try:
            values[k] = _view(manifest, calibration, views[k], background)
        except FabricError as error:
            problems[k] = f"{_named(views[k][0])}: {error}; left out"

    with told("photographs of views", len(views)) as tell:
        for first in range(0, len(views), CHUNK):
            chunk = range(first, min(first + CHUNK, len(views)))

            def make(chunk: range = chunk) -> Floats:
                batches = Batches(worker_count(workers), lambda _, n: one(chunk[n]))
                if not batches.run(len(chunk), lambda done: tell(chunk.start + done)):
                    raise KeyboardInterrupt
                return values[chunk.start : chunk.stop]

            told_by = _key(manifest, calibration, views[chunk.start : chunk.stop], background)
            values[chunk.start : chunk.stop] = kept("views", told_by, make)
            for k in chunk:
                # Only values are kept. Why a view has none, its frames say again.
                if np.isnan(values[k, 0, 0]) and k not in problems:
                    one(k)
    return values, problems


def _key(
    manifest: Manifest, calibration: Calibration, views: list[list[Shot]], background: str
) -> Iterator[object]:  # fmt: skip
    """All that the sums of these views depend on."""
    sensor = calibration.sensor
    yield from (_sources(), manifest.pattern, manifest.bits, background, sensor.hdr)
    yield from (calibration.frame, sensor.response, sensor.hot, sorted(sensor.dark))
    yield from (sensor.dark[seconds] for seconds in sorted(sensor.dark))
    for shots in views:
        for shot in shots:
            path = manifest.folder / shot.file
            try:
                found = path.stat()
                state: Any = (found.st_size, found.st_mtime_ns, found.st_ino)
            except (OSError, ValueError):
                state = None
            yield (str(path.absolute()), shot.exposure, state)


@cache
def _sources() -> str:
    """A digest of the code that sums frames."""
    digest = hashlib.blake2b(digest_size=10)
    here = Path(__file__).resolve().parent
    for path in [*sorted(here.glob("*.py")), Path(fabricusd.images.raw.__file__)]:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _view(
    manifest: Manifest, calibration: Calibration, shots: list[Shot], background: str
) -> Floats:
    """(2, 3) H summed by two halves of the shots; the second is NaN without a second shot."""
    frame = calibration.frame
    frames: dict[float, list[NDArray[Any]]] = {}
    for seconds, group in by_exposure(shots).items():
        frames[seconds] = [
            read_frame(manifest, shot, frame.shape)[frame.top : frame.bottom] for shot in group
        ]
    halves = [frames]
    if all(len(group) > 1 for group in frames.values()):
        halves = [{t: group[k::2] for t, group in frames.items()} for k in range(2)]
    out = np.full((2, 3), np.nan)
    for k, half in enumerate(halves):
        merged = merge(half, calibration.sensor)
        _require_unsaturated(merged, frame)
        out[k] = thread_sum(merged.radiance, frame, manifest.pattern, background)
    return out


def _require_unsaturated(merged: Merged, frame: Frame) -> None:
    if merged.lost > MOST_LOST * frame.sites:
        raise FabricError(
            "", f"{merged.lost} sites are saturated in every exposure; add a shorter one"
        )


def _named(shot: Shot) -> str:
    angles = ", ".join(
        f"{name} {np.degrees(angle):.4g}"
        for name, angle in (
            ("theta_i", shot.theta_i), ("theta_o", shot.theta_o), ("phi_d", shot.phi_d),
        )
    )  # fmt: skip
    return f"view {angles}"

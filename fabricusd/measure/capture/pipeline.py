"""The whole way from a folder of photographs to lobes, a view at a time, on every core."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.measure.capture.frames import Frame, frame_of, read_frame
from fabricusd.measure.capture.manifest import Manifest, Shot, by_exposure, read_manifest
from fabricusd.measure.capture.merge import HDR, Merged, Sensor, merge
from fabricusd.measure.capture.noise import deviation, variance_model
from fabricusd.measure.capture.reflectance import (
    BACKGROUNDS,
    channel_means,
    imaged_diameter,
    thread_sum,
)
from fabricusd.measure.capture.response import linear_response, patch_means, spline_response
from fabricusd.measure.lobes import Lobes, gaps
from fabricusd.measure.progress import told
from fabricusd.run.workers import Batches, worker_count

Floats = NDArray[np.float64]

MOST_LOST = 1e-3
"""Share of a thread's window that may be saturated in every exposure: hot sites of the sensor."""
LEAST_RELATIVE = 1e-3
"""Least standard deviation of a value over it: the response is not known better."""
MOST_TOLD = 20
"""Lines about single frames that are kept; the rest is counted."""


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """What a folder of photographs gave.

    lobes : Lobes; response : (levels + 1,) exposure of each code
    diameter : of the imaged thread [pixels], None where it is not known
    captures, views, skipped : frames read, views, and those of them that could not be used
    """

    lobes: Lobes
    response: Floats
    diameter: float | None
    captures: int
    views: int
    skipped: int


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """frame : Frame; sensor : Sensor; white : (3,) L_co; diameter : [pixels] or None"""

    frame: Frame
    sensor: Sensor
    white: Floats
    diameter: float | None
    captures: int
    notes: tuple[str, ...]


def measure(
    folder: str | os.PathLike[str],
    *,
    hdr: str = "counts",
    background: str = "sides",
    workers: int | None = None,
) -> Measurement:
    """Lobes of the thread that `folder` has photographs of; see `manifest.read_manifest`.

    hdr : "counts", or "thesis" for eq. 3.3 as printed; see `merge`
    background : "sides", or "zero" for the thesis's threshold; see `reflectance.thread_sum`

    Frames are read once, a view at a time, so memory does not grow with the folder. A view that
    cannot be used is left out and noted. Raises FabricError if no view is left, and for a folder
    that cannot be measured at all.
    """
    for name, value, allowed in (("hdr", hdr, HDR), ("background", background, BACKGROUNDS)):
        if value not in allowed:
            raise FabricError(name, f"is '{value}'; it must be one of {', '.join(allowed)}")
    manifest = read_manifest(folder)
    calibration = calibrate(manifest, hdr)
    views = manifest.views()
    values = np.full((len(views), 2, 3), np.nan)
    problems: dict[int, str] = {}

    def one(_worker: int, k: int) -> None:
        try:
            values[k] = _view(manifest, calibration, views[k], background)
        except FabricError as error:
            problems[k] = f"{_named(views[k][0])}: {error}; left out"

    with told("photographs of views", len(views)) as tell:
        if not Batches(worker_count(workers), one).run(len(views), tell):
            raise KeyboardInterrupt
    used = [k for k in range(len(views)) if k not in problems]
    told_lines = [problems[k] for k in sorted(problems)]
    if not used:
        raise FabricError(str(manifest.folder), f"has no view that can be used: {told_lines[0]}")
    notes = [*_shortened([*manifest.notes, *told_lines]), *calibration.notes]
    lobes = _lobes(manifest, calibration, [views[k][0] for k in used], values[used], notes)
    return Measurement(
        lobes=lobes,
        response=calibration.sensor.response.astype(np.float64),
        diameter=calibration.diameter,
        captures=calibration.captures + sum(len(view) for view in views),
        views=len(views),
        skipped=len(problems),
    )


def calibrate(manifest: Manifest, hdr: str = "counts") -> Calibration:
    """Size, black level, response and white reference; FabricError if one cannot be had."""
    notes: list[str] = []
    first = next(iter(manifest.of_kind("white").values()))[0]
    shape = read_frame(manifest, first).shape
    frame = frame_of(manifest, (shape[0], shape[1]))
    dark = _stacks(manifest, "dark", frame, notes)
    if not dark:
        raise FabricError(str(manifest.folder), f"has no dark frame that can be read: {notes[0]}")
    black = float(np.mean(next(iter(dark.values()))))
    if not black < 0.4 * manifest.levels:
        raise FabricError(
            str(manifest.folder), f"has dark frames of code {black:.0f}; they must be below "
            f"{0.4 * manifest.levels:.0f}",
        )  # fmt: skip
    if manifest.linear:
        response = linear_response(manifest.levels, black)
    else:
        response = _response(manifest, black, frame, notes)
    table = response.astype(np.float32)
    exposures = {
        seconds: np.mean([_site_means(table[codes]) for codes in shots], axis=0)
        for seconds, shots in dark.items()
    }
    sensor = Sensor(response=table, dark=exposures, levels=manifest.levels, hdr=hdr)
    white = merge(_required(manifest, "white", frame, notes), sensor)
    if white.lost:
        raise FabricError(
            str(manifest.folder), "has a white tile that is saturated in every exposure; add a "
            "shorter one",
        )  # fmt: skip
    level = channel_means(white.radiance, manifest.pattern)
    if not (level > 0).all():
        raise FabricError(
            str(manifest.folder), "has a white tile that is no brighter than darkness"
        )
    diameter = manifest.diameter or _diameter(manifest, frame, sensor, notes)
    if diameter is None:
        notes.append(
            "the thread's imaged diameter is unknown, so its lobes are relative: state "
            "diameter_px, or add a focused shot"
        )
    count = sum(shot.kind not in ("slice", "half") for shot in manifest.shots)
    return Calibration(
        frame=frame, sensor=sensor, white=level, diameter=diameter, captures=count,
        notes=tuple(notes),
    )  # fmt: skip


def _response(manifest: Manifest, black: float, frame: Frame, notes: list[str]) -> Floats:
    times, means = [], []
    for seconds, shots in manifest.of_kind("chart").items():
        total = np.zeros(frame.shape)
        count = 0
        for shot in shots:
            codes = _tried(manifest, shot, frame, notes)
            if codes is not None:
                total += codes
                count += 1
        if count:
            times.append(seconds)
            means.append(patch_means(total / count, *manifest.chart))
    if len(times) < 2:
        raise FabricError(
            str(manifest.folder),
            f"has {len(times)} exposure(s) of the chart; there must be two or more",
        )
    try:
        return spline_response(np.array(means), np.array(times), manifest.levels, black)
    except FabricError as error:
        raise error.inside(str(manifest.folder)) from None


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


def _lobes(
    manifest: Manifest, calibration: Calibration, shots: list[Shot], values: Floats,
    notes: list[str],
) -> Lobes:  # fmt: skip
    """Eqs. 3.6 and 3.7 of every view, with the deviations that pairs of shots tell."""
    total = np.nanmean(values, axis=1)
    deviations = np.empty_like(total)
    paired = np.isfinite(values[:, 1, 0])
    for channel in range(3):
        q = total[:, channel]
        if paired.sum() > 1:
            model = variance_model(q[paired], np.diff(values[paired, :, channel], axis=1)[:, 0])
            found = deviation(q, model)
            found[~paired] *= np.sqrt(2.0)
        else:
            found = np.full(len(q), 0.03 * float(np.median(np.abs(q))))
        deviations[:, channel] = np.hypot(found, LEAST_RELATIVE * np.abs(q))
    if paired.sum() <= 1:
        notes.append(
            "there are no two shots of an exposure to tell the noise by: a deviation of 3 % of the "
            "median value is assumed"
        )
    theta_i = np.array([shot.theta_i for shot in shots])
    area = calibration.frame.height * (calibration.diameter or 1.0)
    reference = np.array(manifest.reflectance) * np.cos(manifest.white_angle)
    scale = reference / (np.pi * calibration.white * area) / np.cos(theta_i)[:, None]
    lobes = Lobes(
        theta_i=theta_i,
        theta_o=np.array([shot.theta_o for shot in shots]),
        phi_d=np.array([shot.phi_d for shot in shots]),
        f=total * scale,
        sigma=np.maximum(deviations * scale, 1e-12),
        absolute=calibration.diameter is not None,
        name=manifest.name,
        notes=tuple(notes),
    )
    found_gaps = list(gaps(lobes))
    if not found_gaps:
        return lobes
    from dataclasses import replace

    return replace(lobes, notes=(*notes, *_shortened(found_gaps)))


def _diameter(
    manifest: Manifest, frame: Frame, sensor: Sensor, notes: list[str]
) -> float | None:  # fmt: skip
    """The imaged diameter [pixels] by the shots of the thread in focus, if there are any."""
    shots = _stacks(manifest, "focused", frame, notes)
    if not shots:
        return None
    radiance = merge(shots, sensor).radiance
    # Green has sites in every column; other colours would alias on a thread of a few pixels.
    columns = np.empty(frame.shape[1])
    if manifest.pattern == "grey":
        columns[:] = radiance.mean(axis=0)
    else:
        odd = int(manifest.pattern.index("G") % 2)
        columns[odd::2], columns[1 - odd :: 2] = (
            radiance[0::2, odd::2].mean(axis=0), radiance[1::2, 1 - odd :: 2].mean(axis=0),
        )  # fmt: skip
    beside = np.concatenate([columns[: frame.left], columns[frame.right :]])
    found = imaged_diameter(columns[frame.left : frame.right], beside)
    if not 0.5 < found < frame.right - frame.left:
        notes.append("the focused shot shows no thread whose diameter could be measured")
        return None
    notes.append(
        f"the thread's imaged diameter is {found:.3g} pixels by the focused shot, which blur makes "
        "too large"
    )
    return found


def _stacks(
    manifest: Manifest, kind: str, frame: Frame, notes: list[str]
) -> dict[float, list[NDArray[Any]]]:  # fmt: skip
    """Exposure -> the rows that are used of every frame of a kind that can be read."""
    found: dict[float, list[NDArray[Any]]] = {}
    for seconds, shots in manifest.of_kind(kind).items():
        read = (_tried(manifest, shot, frame, notes) for shot in shots)
        frames = [codes[frame.top : frame.bottom] for codes in read if codes is not None]
        if frames:
            found[seconds] = frames
    return found


def _required(
    manifest: Manifest, kind: str, frame: Frame, notes: list[str]
) -> dict[float, list[NDArray[Any]]]:  # fmt: skip
    found = _stacks(manifest, kind, frame, notes)
    if not found:
        raise FabricError(
            str(manifest.folder), f"has no {kind} frame that can be read: {notes[-1]}"
        )
    return found


def _tried(
    manifest: Manifest, shot: Shot, frame: Frame, notes: list[str]
) -> NDArray[Any] | None:  # fmt: skip
    """The codes of a calibration frame, or None with a note."""
    try:
        return read_frame(manifest, shot, frame.shape)
    except FabricError as error:
        notes.append(f"{error}; left out")
        return None


def _site_means(exposure: NDArray[Any]) -> Floats:
    return np.array([exposure[s // 2 :: 2, s % 2 :: 2].mean(dtype=np.float64) for s in range(4)])


def _named(shot: Shot) -> str:
    angles = ", ".join(
        f"{name} {np.degrees(angle):.4g}"
        for name, angle in (
            ("theta_i", shot.theta_i), ("theta_o", shot.theta_o), ("phi_d", shot.phi_d),
        )
    )  # fmt: skip
    return f"view {angles}"


def _shortened(lines: list[str]) -> list[str]:
    if len(lines) <= MOST_TOLD:
        return lines
    return [*lines[:MOST_TOLD], f"and {len(lines) - MOST_TOLD} more"]

"""What a folder says of its camera and its light: black level, response, white reference, scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.measure.capture.frames import Frame, frame_of, read_frame
from fabricusd.measure.capture.manifest import Manifest, Shot
from fabricusd.measure.capture.merge import Sensor, hot_sites, merge
from fabricusd.measure.capture.reflectance import channel_means, imaged_diameter
from fabricusd.measure.capture.response import linear_response, patch_means, spline_response

Floats = NDArray[np.float64]

MOST_LOST = 1e-3
"""Share of the sites that may be saturated in every exposure, by cosmic rays for example."""
MOST_SPREAD = 0.02
"""Share of the largest code by which 80 % of a dark frame's codes may differ."""
LEAST_NOISE = 0.4
"""Deviation of dark codes below which rounding to whole codes does not average out: at .4 the mean
of rounded numbers is up to .014 of a code off, at .26 up to .08."""
MOST_HOT = 0.01
"""Share of the sites that may be hot; a sensor with more is none, or was not in the dark."""


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """frame : Frame; sensor : Sensor; white : (3,) L_co; diameter : [pixels] or None"""

    frame: Frame
    sensor: Sensor
    white: Floats
    diameter: float | None
    captures: int
    notes: tuple[str, ...]


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
    hot = _hot(manifest, dark[max(dark)], notes)
    sensor = Sensor(response=table, dark=exposures, levels=manifest.levels, hdr=hdr, hot=hot)
    white = merge(_required(manifest, "white", frame, notes), sensor)
    if white.lost > MOST_LOST * white.radiance.size:
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


def _hot(
    manifest: Manifest, frames: list[NDArray[Any]], notes: list[str]
) -> NDArray[np.intp]:  # fmt: skip
    """The hot sites, noted, as is too little noise; FabricError for frames that have seen light."""
    mean = np.mean(frames, axis=0)
    hot = hot_sites(mean)
    spread = float(np.percentile(mean, 90) - np.percentile(mean, 10))
    if spread > MOST_SPREAD * manifest.levels or len(hot) > MOST_HOT * mean.size:
        raise FabricError(
            str(manifest.folder),
            f"has dark frames whose codes differ by {spread:.0f} from site to site, with "
            f"{len(hot)} brighter sites; they must be even: was the lens covered?",
        )
    noise = float(np.std(frames, axis=0, ddof=1).mean()) if len(frames) > 1 else 1.0
    if noise < LEAST_NOISE:
        notes.append(
            f"the noise of dark frames is {noise:.2g} of a code, too little for rounding to "
            "average out: values of dim views are off by more than their deviations"
        )
    if len(hot):
        notes.append(f"{len(hot)} hot site(s) of the sensor are replaced by their neighbours")
    return hot


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

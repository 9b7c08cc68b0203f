"""The whole way from a folder of photographs to lobes, a view at a time, on every core."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.measure.capture.calibrate import Calibration, calibrate
from fabricusd.measure.capture.manifest import Manifest, Shot, read_manifest
from fabricusd.measure.capture.merge import HDR
from fabricusd.measure.capture.noise import deviation, variance_model
from fabricusd.measure.capture.reflectance import BACKGROUNDS
from fabricusd.measure.capture.views import view_sums
from fabricusd.measure.lobes import Lobes, gaps

Floats = NDArray[np.float64]

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

    Frames are read once, a view at a time, so memory does not grow with the folder. A run that was
    broken off goes on where it was, see `views`. A view that cannot be used is left out and noted.
    Raises FabricError if no view is left, and for a folder
    that cannot be measured at all.
    """
    for name, value, allowed in (("hdr", hdr, HDR), ("background", background, BACKGROUNDS)):
        if value not in allowed:
            raise FabricError(name, f"is '{value}'; it must be one of {', '.join(allowed)}")
    manifest = read_manifest(folder)
    calibration = calibrate(manifest, hdr)
    views = manifest.views()
    values, problems = view_sums(manifest, calibration, views, background, workers)
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
    return replace(lobes, notes=(*notes, *_shortened(found_gaps)))


def _shortened(lines: list[str]) -> list[str]:
    if len(lines) <= MOST_TOLD:
        return lines
    return [*lines[:MOST_TOLD], f"and {len(lines) - MOST_TOLD} more"]

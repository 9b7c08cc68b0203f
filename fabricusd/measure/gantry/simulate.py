"""Photograph a thread whose scattering is known: a folder as `measure` reads it."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.thread import split
from fabricusd.errors import FabricError, one_line
from fabricusd.fabric import DEFAULT_MODEL, Thread
from fabricusd.files import write_json
from fabricusd.images.raw import write_codes
from fabricusd.measure.angles import DEGREE, Floats, direction
from fabricusd.measure.capture.manifest import MANIFEST, VERSION
from fabricusd.measure.gantry.camera import Camera, mosaicked
from fabricusd.measure.gantry.design import DESIGNS
from fabricusd.measure.gantry.scenes import chart_radiance, thread_radiance, white_radiance
from fabricusd.run.workers import Batches, worker_count

BRF = (0.989, 0.989, 0.988)
"""Reflectance factor of the white tile, lit at 8 degrees and seen face on: [Bisker2011] 3.2.6."""

WHITE_ANGLE = 8.0 * DEGREE
CHART_ROWS, CHART_COLUMNS = 4, 6
CHART_TIMES = np.geomspace(0.01, 1.2, 12)
CHART_SHOTS = WHITE_SHOTS = 4
DARK_SHOTS = 8
PATCH_GREYS = np.geomspace(0.01, 0.3, CHART_ROWS * CHART_COLUMNS)


@dataclass(frozen=True, kw_only=True)
class Shoot:
    """How the thread is photographed.

    design : one of DESIGNS; shape : (h, w) of a frame, both even; times : exposures [s]
    shots : frames of each exposure, of which two tell the noise
    diameter, defocus : of the imaged thread [pixels]; noise : whether there is any
    """

    design: str = "slice"
    shape: tuple[int, int] = (48, 96)
    times: tuple[float, ...] = (0.02, 0.08, 0.25, 0.8)
    shots: int = 2
    diameter: float = 5.0
    defocus: float = 3.0
    noise: bool = True


def simulate(
    thread: Thread,
    folder: str | os.PathLike[str],
    *,
    camera: Camera | None = None,
    shoot: Shoot | None = None,
    name: str = "thread",
    model: str = "",
    seed: int = 0,
    workers: int | None = None,
) -> int:
    """Write the frames and their manifest into an empty or new `folder`; return the frames' number.

    The manifest is written last, so a folder that has one is complete. Two folders of the same
    arguments are equal, however many workers make them. Raises FabricError for a folder that holds
    something, and for an unknown design.
    """
    camera, shoot = camera or Camera(), shoot or Shoot()
    if shoot.design not in DESIGNS:
        raise FabricError("design", f"is '{shoot.design}'; it must be one of {', '.join(DESIGNS)}")
    target = _empty(folder)
    theta_i, theta_o, phi_d = DESIGNS[shoot.design]()
    chosen = model or thread.model or DEFAULT_MODEL
    terms = split(thread, direction(theta_i, 0.0), direction(theta_o, phi_d), chosen)
    f = terms.surface[:, None] + terms.volume[:, None] * np.asarray(thread.albedo)
    jobs = [*_calibration(camera, shoot), *_views(f, theta_i, theta_o, phi_d, shoot)]

    def take(_worker: int, k: int) -> None:
        job = jobs[k]
        rng = np.random.default_rng([seed & (2**63 - 1), k])
        radiance = job.radiance(rng)
        for file, seconds in job.frames:
            codes = camera.expose(radiance, seconds, rng if shoot.noise else None)
            write_codes(target / file, codes, durable=False)

    from fabricusd.measure.progress import told

    with told("photographs", len(jobs)) as tell:
        if not Batches(worker_count(workers), take).run(len(jobs), tell):
            raise KeyboardInterrupt
    write_json(target / MANIFEST, _manifest(camera, shoot, name, jobs))
    return sum(len(job.frames) for job in jobs)


@dataclass(frozen=True)
class Job:
    """Frames of one scene.

    radiance : random numbers -> (h, w) behind the mosaic; frames : (file, exposure [s])
    told : what the manifest says of each of them, its kind and angles
    """

    radiance: Callable[[np.random.Generator], Floats]
    frames: tuple[tuple[str, float], ...]
    told: dict[str, Any]


def _calibration(camera: Camera, shoot: Shoot) -> list[Job]:
    """Dark frames, the white tile, the chart, and the thread in focus."""
    white = white_radiance(np.array(BRF) * np.cos(WHITE_ANGLE) / np.pi, shoot.shape)
    chart = chart_radiance(PATCH_GREYS, CHART_ROWS, CHART_COLUMNS, shoot.shape)

    def still(radiance: Floats) -> Callable[[np.random.Generator], Floats]:
        return lambda rng: mosaicked(radiance)

    def focused(rng: np.random.Generator) -> Floats:
        value = np.full(3, 0.3)
        return mosaicked(thread_radiance(value, shoot.shape, shoot.diameter, 0.0, 0.3, rng))

    dark = still(np.zeros((*shoot.shape, 3)))
    kinds = (
        ("dark", dark, shoot.times, DARK_SHOTS),
        ("white", still(white), shoot.times, WHITE_SHOTS),
        ("chart", still(chart), CHART_TIMES, CHART_SHOTS),
        ("focused", focused, shoot.times, WHITE_SHOTS),
    )
    return [
        Job(radiance, _frames(kind, times, shots), {"kind": kind})
        for kind, radiance, times, shots in kinds
    ]


def _views(
    f: Floats, theta_i: Floats, theta_o: Floats, phi_d: Floats, shoot: Shoot
) -> list[Job]:  # fmt: skip
    kind = "half" if np.any(phi_d > 0) else "slice"
    jobs = []
    for k in range(len(f)):
        value = f[k] * np.cos(theta_i[k])

        def seen(rng: np.random.Generator, value: Floats = value) -> Floats:
            colour = thread_radiance(value, shoot.shape, shoot.diameter, shoot.defocus, 0.3, rng)
            return mosaicked(colour)

        told: dict[str, Any] = {"kind": kind}
        for name, angle in (("theta_i", theta_i), ("theta_o", theta_o), ("phi_d", phi_d)):
            told[name] = round(float(angle[k]) / DEGREE, 4)
        jobs.append(Job(seen, _frames(f"view_{k:05d}", shoot.times, shoot.shots), told))
    return jobs


def _frames(
    stem: str, times: tuple[float, ...] | NDArray[Any], shots: int
) -> tuple[tuple[str, float], ...]:
    return tuple(
        (f"{stem}_{e:02d}_{s}.pgm", float(f"{t:.6g}")) for e, t in enumerate(times)
        for s in range(shots)
    )  # fmt: skip


def _manifest(camera: Camera, shoot: Shoot, name: str, jobs: list[Job]) -> dict[str, Any]:
    return {
        "fabricusd:measurement": VERSION,
        "name": name,
        "bits": camera.bits,
        "pattern": "RGGB",
        "linear": False,
        "diameter_px": shoot.diameter,
        "white": {"reflectance": list(BRF), "angle": round(WHITE_ANGLE / DEGREE, 6)},
        "chart": {"rows": CHART_ROWS, "columns": CHART_COLUMNS},
        "shots": [
            {"file": file, "exposure": seconds, **job.told}
            for job in jobs
            for file, seconds in job.frames
        ],
    }


def require_empty(folder: str | os.PathLike[str]) -> None:
    """Raise FabricError for a folder that holds something, or that cannot be made."""
    target = Path(folder)
    try:
        occupied = next(target.iterdir(), None) if target.exists() else None
        parent = target.parent.is_dir()
    except (OSError, ValueError) as error:
        problem = f"cannot be used: {getattr(error, 'strerror', None) or error}"
        raise FabricError(one_line(repr(str(target)), 120), problem) from error
    if not parent:
        raise FabricError(
            str(target), f"is in '{target.parent}', which is not a directory; create it first"
        )
    if occupied is not None:
        raise FabricError(
            str(target), f"holds '{occupied.name}'; it must be a new or an empty folder"
        )


def _empty(folder: str | os.PathLike[str]) -> Path:
    """`folder`, made if it does not exist."""
    require_empty(folder)
    target = Path(folder)
    try:
        target.mkdir(exist_ok=True)
    except OSError as error:
        raise FabricError(str(target), f"cannot be made: {error.strerror}") from error
    return target

"""What a run tells about a picture: notes on what it lost, and metadata on how it was made."""

from __future__ import annotations

import os
import platform
from typing import Any

import numba
import numpy as np

import fabricusd
from fabricusd.images.view import View
from fabricusd.reference.integrator import Tracer
from fabricusd.reference.nothing_seen import reason_for_nothing
from fabricusd.reference.rays.camera import Lens
from fabricusd.scene.scene import Scene

TOLD_CUT = 0.01
"""Share of the light above which a note says that bounds on bounces cut it off."""


def note_losses(
    scene: Scene,
    tracer: Tracer,
    lens: Lens,
    not_finite: int,
    cut: float,
    met: bool,
    size: tuple[int, int],
) -> None:
    """Note values that were not finite, light that was cut off, and why a picture shows nothing."""
    if not_finite:
        scene.note("the picture", f"lost {not_finite} values that were not finite")
    if cut > TOLD_CUT:
        bounds = f"max bounces {tracer.max_bounces}"
        if tracer.translucent.any():
            bounds += f" and max translucent {tracer.max_translucent}"
        scene.note(
            "the picture",
            f"lost up to {100 * cut:.2g} % of its light: {bounds} ended paths that still carried "
            "as much",
        )
    if not met and len(tracer.tables.triangles):
        scene.note("the picture", reason_for_nothing(tracer, lens, *size))


def asked_for(source: Any, time_code: float | None, stops: float, view: View) -> dict[str, Any]:
    """The metadata that tell a picture's source and how its PNG was made."""
    known: dict[str, Any] = {"fabricusd:exposure": stops, "fabricusd:view": str(view)}
    if not isinstance(source, Scene):
        known["fabricusd:scene"] = os.fspath(source)
    if time_code is not None:
        known["fabricusd:timeCode"] = float(time_code)
    return known


def versions() -> dict[str, Any]:
    """The metadata that name the programs and versions that made a picture."""
    return {
        "Software": f"fabricusd {fabricusd.__version__}",
        "fabricusd:python": platform.python_version(),
        "fabricusd:numpy": np.__version__,
        "fabricusd:numba": numba.__version__,
    }

"""Explaining an empty picture: tests whether the camera's clipping planes cut everything away."""

from __future__ import annotations

import numpy as np

from fabricusd.reference.integrator import Tracer
from fabricusd.reference.rays.camera import Lens
from fabricusd.reference.rays.embree import INFINITE_DISTANCE
from fabricusd.reference.rays.wave import ALPHA, Wave

LOOKED = 1 << 14
"""Largest number of pixels that are traced again, spread evenly over the picture."""


def reason_for_nothing(tracer: Tracer, lens: Lens, width: int, height: int) -> str:
    """The note for a picture in which no camera ray hit anything.

    Traces rays of the same camera again without its near plane, then without its far plane, then
    without either.
    """
    near, far = float(lens.near), float(lens.far)
    if near > 0 and _meets(tracer, lens._replace(near=np.float32(0)), width, height):
        return f"shows nothing: the near clipping plane, at {near:.4g} m, cuts everything away"
    if lens.far < INFINITE_DISTANCE and _meets(
        tracer, lens._replace(far=INFINITE_DISTANCE), width, height
    ):
        return f"shows nothing: the far clipping plane, at {far:.4g} m, cuts everything away"
    open_lens = lens._replace(near=np.float32(0), far=INFINITE_DISTANCE)
    if near > 0 and lens.far < INFINITE_DISTANCE and _meets(tracer, open_lens, width, height):
        return (
            f"shows nothing: everything the camera would see is outside its clipping range, "
            f"{near:.4g} to {far:.4g} m"
        )
    return "shows nothing: no camera ray hits anything; point the camera at the scene"


def _meets(tracer: Tracer, lens: Lens, width: int, height: int) -> bool:
    """Whether one sample in any of the tested pixels hits a surface."""
    count = width * height
    # Multiples of the golden ratio reach every part of the rows and of the columns.
    steps = np.arange(min(count, LOOKED)) * 0.6180339887498949 % 1.0
    pixels = (steps * count).astype(np.int32)
    wave = Wave(len(pixels), aovs=False)
    tracer.trace(wave, lens, width, pixels, 0, 1, np.zeros(3, np.int64), np.zeros(1))
    return bool((wave.film[ALPHA, : len(pixels)] > 0).any())

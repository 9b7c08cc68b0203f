"""What is fitted of a thread: names, ranges, and the numbers that stand for what cannot be told."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.scattering.model import CONSERVING
from fabricusd.appearance.scattering.models import named
from fabricusd.fabric import Thread
from fabricusd.measure.angles import DEGREE

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A number that the scattering is not linear in.

    name : a field of Thread, or "lean"; label : in a report; scale : SI value of a report's unit
    low, high : of the search; start : (low, high) that starts are drawn from
    step : its usual change
    """

    name: str
    label: str
    low: float
    high: float
    start: tuple[float, float]
    step: float
    scale: float = 1.0
    unit: str = ""


IOR = Parameter(name="ior", label="eta", low=1.02, high=2.6, start=(1.25, 1.75), step=0.1)
GAMMA_SURFACE = Parameter(
    name="gamma_surface", label="gs", low=0.3 * DEGREE, high=60 * DEGREE,
    start=(1.5 * DEGREE, 32 * DEGREE), step=0.1, scale=DEGREE, unit="degrees",
)  # fmt: skip
GAMMA_VOLUME = Parameter(
    name="gamma_volume", label="gv", low=0.5 * DEGREE, high=90 * DEGREE,
    start=(3 * DEGREE, 65 * DEGREE), step=0.2, scale=DEGREE, unit="degrees",
)  # fmt: skip
ISOTROPIC = Parameter(
    name="isotropic", label="kd", low=0.0, high=1.0, start=(0.05, 0.8), step=0.2
)  # fmt: skip
SURFACE_GAIN = Parameter(
    name="surface_gain", label="ks", low=0.02, high=40.0, start=(1.0, 12.0), step=1.0
)
LEAN = Parameter(
    name="lean", label="lean", low=-6 * DEGREE, high=6 * DEGREE,
    start=(-0.1 * DEGREE, 0.1 * DEGREE), step=0.02, scale=DEGREE, unit="degrees",
)  # fmt: skip


def parameters(model: str, *, gain: bool, lean: bool) -> tuple[Parameter, ...]:
    """What a fit of `model` varies. The conserving model has a gain of its surface term, which is
    left at 1 where a gain of all values is free: together they could not be told apart."""
    found = [IOR, GAMMA_SURFACE, GAMMA_VOLUME, ISOTROPIC]
    if named(model).law == CONSERVING and not gain:
        found.append(SURFACE_GAIN)
    if lean:
        found.append(LEAN)
    return tuple(found)


def thread_of(
    names: Sequence[Parameter], x: Sequence[float] | Floats, albedo: Sequence[float] = (0, 0, 0)
) -> Thread:
    """The thread that a vector of parameters stands for."""
    fields: dict[str, Any] = {
        p.name: float(v) for p, v in zip(names, x, strict=True) if p.name != "lean"
    }
    return Thread(albedo=(float(albedo[0]), float(albedo[1]), float(albedo[2])), **fields)


def volume_level(model: str, gamma_volume: float, isotropic: float) -> float:
    """The volume term's lobe on the mirror cone, per unit of albedo.

    `A volume_level` is what views tell of a lobe too wide to be told from an isotropic one:
    kd + (1 - kd) g(gv, 0), and for the conserving model kd/pi^2 + (1 - kd) K(0, 0; 2 gv)/(2 pi).
    """
    if named(model).law == CONSERVING:
        v = (2.0 * gamma_volume) ** 2
        from scipy.special import i0e

        lobe = float(i0e(1.0 / v)) / (v * -math.expm1(-2.0 / v)) / (2.0 * math.pi)
        return isotropic / math.pi**2 + (1.0 - isotropic) * lobe
    return isotropic + (1.0 - isotropic) / (gamma_volume * math.sqrt(2.0 * math.pi))


def level_formula(model: str) -> str:
    """`volume_level` times the albedo, in a report."""
    if named(model).law == CONSERVING:
        return "A (kd/pi^2 + (1 - kd) K(0, 0; 2 gv)/(2 pi))"
    return "A (kd + (1 - kd) g(gv, 0))"

"""What one layer of cloth does with light, by the albedo of its threads."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.layer.fuzz import Fuzzed
from fabricusd.appearance.scattering.models.conserving import plain_albedo
from fabricusd.fabric import Fabric, Thread

Floats = NDArray[np.float64]

_INCLINATIONS = 41
"""Entries of the table of E(theta): between them E is linear, and right to 1e-4."""


@dataclass(frozen=True, kw_only=True)
class Layer:
    """Shares of the light on one layer, for a view at 8 degrees (row 0) and diffuse light (row 1).

    surface : (2, 2) - what the surfaces send at once to the own and to the other side
    volume : (2, 2, k) - the same of white threads' insides, per thread of the fabric
    rest : (2, 2) - what bounces between threads and leaves, at C = 1
    gap : (2,) - what passes between the threads
    escape : float - `p`
    mean : (k,) - weights of the threads in alpha, which sum to at most 1
    bright : (k,) - mean directional albedo of each thread's surface
    fuzz : what lies over it where threads are hairy
    """

    surface: Floats
    volume: Floats
    rest: Floats
    gap: Floats
    escape: float
    mean: Floats
    bright: Floats
    fuzz: Fuzzed | None = None

    def of(self, albedo: Floats) -> Floats:
        """(2, 2, ...) R and T by row for albedos (k, ...) of the threads."""
        a = np.clip(np.asarray(albedo, np.float64), 0.0, 1.0)
        bright = self.bright.reshape(-1, *(1,) * (a.ndim - 1))
        alpha = np.tensordot(self.mean, bright + (1.0 - bright) * a, axes=1)
        strength = alpha**2 * self.escape / (1.0 - alpha * (1.0 - self.escape))
        grow = (..., *(None,) * (a.ndim - 1))
        found = self.surface[grow] + np.tensordot(self.volume, a, axes=1)
        found = found + self.rest[grow] * strength
        if self.fuzz is not None:
            found = self.fuzz.over(found, a)
        found[:, 1] += self.gap[grow]
        return np.asarray(found)


def alone(fabric: Fabric, thread: Thread) -> Fabric:
    """Cloth of the weave and the densities of `fabric`, woven of `thread` only."""
    return replace(
        fabric,
        threads={"Thread": thread},
        warp=replace(fabric.warp, sequence=(0,)),
        weft=replace(fabric.weft, sequence=(0,)),
        back=None,
    )


def _plain(thread: Thread) -> Thread:
    """The thread without what its scattering does not depend on: the key of cached tables."""
    return Thread(
        ior=thread.ior,
        isotropic=thread.isotropic,
        gamma_surface=thread.gamma_surface,
        gamma_volume=thread.gamma_volume,
        surface_gain=thread.surface_gain,
    )


def surface_albedo(thread: Thread, theta: Floats) -> Floats:
    """E at inclinations theta [rad]."""
    at, albedo = plain_albedo(_plain(thread), _INCLINATIONS)
    return np.asarray(np.interp(np.abs(theta), at, albedo))


def mean_surface(thread: Thread) -> float:
    """(2/pi) times the integral of E cos^2 theta over +-90 degrees."""
    x, w = np.polynomial.legendre.leggauss(64)
    theta = math.pi / 4 * (x + 1.0)
    return float(w @ (surface_albedo(thread, theta) * np.cos(theta) ** 2))

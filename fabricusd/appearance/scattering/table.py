"""Threads as rows of numbers: constants computed once, in float64, for the kernels to read."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.scattering import terms as column
from fabricusd.appearance.scattering.lobes import (
    LARGEST_IOR,
    NARROWEST,
    gaussian_constants,
    longitudinal_constants,
)
from fabricusd.fabric import MODELS, Fabric, Thread
from fabricusd.kernels.real import KERNEL

Reals = NDArray[Any]

_PIECES = 6
"""Intervals on each side of the mirror cone, each of _NODES Gauss-Legendre points."""
_NODES = 12
_AZIMUTHS = 24
_REACH = 9.0
"""Half-width of the interval that the quadrature covers, in standard deviations of theta."""


def pack_threads(fabric: Fabric, precision: type[np.floating[Any]] = np.float64) -> Reals:
    """(k, COLUMNS) table of the fabric's threads, each with the model that the fabric gives it."""
    rows = [thread_row(t, fabric.model_of(t)) for t in fabric.thread_list]
    return np.ascontiguousarray(rows, dtype=precision)


def thread_row(thread: Thread, model: str) -> NDArray[np.float64]:
    """(COLUMNS,) float64 of one thread evaluated by `model`, columns as in `thread_terms`.

    The albedo of the `conserving` model is clamped to 1: it is an albedo there.
    """
    row = np.zeros(column.COLUMNS)
    conserving = model == MODELS[column.CONSERVING]
    albedo = np.array(thread.albedo)
    row[column.ALBEDO_R : column.ALBEDO_B + 1] = np.minimum(albedo, 1.0) if conserving else albedo
    row[column.BRIGHTNESS] = row[column.ALBEDO_R : column.ALBEDO_B + 1].mean()
    row[column.MODEL] = MODELS.index(model)
    ior = min(thread.ior, LARGEST_IOR)
    row[column.IOR_EXCESS] = (ior - 1.0) * (ior + 1.0)
    row[column.ISOTROPIC] = thread.isotropic
    row[column.SURFACE_GAIN] = thread.surface_gain
    gs, gv = max(thread.gamma_surface, NARROWEST), max(thread.gamma_volume, NARROWEST)
    row[column.GAMMA_SURFACE], row[column.GAMMA_VOLUME] = gs, gv
    for first, constants in (
        (column.SURFACE_GAUSSIAN, gaussian_constants(gs)),
        (column.VOLUME_GAUSSIAN, gaussian_constants(gv)),
        (column.SURFACE_KERNEL, longitudinal_constants(2.0 * gs)),
        (column.VOLUME_KERNEL, longitudinal_constants(2.0 * gv)),
    ):
        row[first : first + 2] = constants
    if conserving:
        through = 1.0 - surface_albedo(gs, thread.ior, thread.surface_gain)
        row[column.TRANSMISSION : -1] = through
        row[-1] = through[-1]
        # A surface that reflects everything lets nothing in: T/T_max is 0, not 0/0.
        largest = float(through.max())
        row[column.INVERSE_T_MAX] = 1.0 / largest if largest > 0 else 0.0
    return row


@lru_cache(maxsize=256)
def surface_albedo(gamma_surface: float, ior: float, surface_gain: float) -> NDArray[np.float64]:
    """(TRANSMISSION_ENTRIES,) directional albedo `E(theta)` of the `conserving` surface term, at
    most 1: `integral f_surface cos(theta_o) dwo` at sqrt(cos theta) uniform from 0 to 1.
    """
    row = np.zeros(column.COLUMNS)
    ior, gamma_surface = min(ior, LARGEST_IOR), max(gamma_surface, NARROWEST)
    row[column.IOR_EXCESS] = (ior - 1.0) * (ior + 1.0)
    row[column.SURFACE_GAIN] = surface_gain
    row[column.GAMMA_SURFACE] = gamma_surface
    constants = longitudinal_constants(2.0 * gamma_surface)
    row[column.SURFACE_KERNEL : column.SURFACE_KERNEL + 2] = constants
    albedo = np.empty(column.TRANSMISSION_ENTRIES)
    x, x_weight = np.polynomial.legendre.leggauss(_NODES)
    y, y_weight = np.polynomial.legendre.leggauss(_AZIMUTHS)
    _integrate_surface(row, x, x_weight, (y + 1) * math.pi / 2, y_weight * math.pi, albedo)
    albedo = np.minimum(albedo, 1.0)
    albedo.flags.writeable = False
    return albedo


@njit(**KERNEL)
def _integrate_surface(row, x, x_weight, phi, phi_weight, out):
    """`out[k]` = E at sqrt(cos theta) = k/(n-1); the nodes follow the lobe, however narrow."""
    R = np.float64
    reach = 2.0 * _REACH * row[column.GAMMA_SURFACE]
    for k in range(out.size):
        cos_theta = (k / (out.size - 1)) ** 2
        sin_theta = math.sqrt(1.0 - cos_theta * cos_theta)
        theta = math.acos(cos_theta)
        high = min(-theta + reach, 0.5 * math.pi)
        # The larger of the two cosines has a kink where the inclinations are opposite or equal.
        bounds = (
            max(-theta - reach, -0.5 * math.pi), -theta, min(theta, high), high,
        )  # fmt: skip
        total = 0.0
        for part in range(3):
            step = (bounds[part + 1] - bounds[part]) / _PIECES
            for node in range(_PIECES * x.size):
                piece, a = divmod(node, x.size)
                o = bounds[part] + step * (piece + 0.5 * (x[a] + 1.0))
                sin_o, cos_o = math.sin(o), max(math.cos(o), 0.0)
                weight = 0.5 * step * x_weight[a] * cos_o * cos_o
                for b in range(phi.size):
                    total += (
                        weight
                        * phi_weight[b]
                        * column.conserving_surface(
                            R, row, sin_theta, cos_theta, sin_o, cos_o, math.cos(0.5 * phi[b])
                        )
                    )
        out[k] = total

"""Pack threads into rows of numbers: the constants that kernels read, computed once in float64."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.scattering import columns as column
from fabricusd.appearance.scattering.lobes import LARGEST_IOR, NARROWEST
from fabricusd.appearance.scattering.models import named
from fabricusd.fabric import MODELS, Fabric, Thread

Reals = NDArray[Any]


def pack_threads(fabric: Fabric, precision: type[np.floating[Any]] = np.float64) -> Reals:
    """(k, COLUMNS) table of the fabric's threads, each with the model that it has in the fabric."""
    rows = [thread_row(t, fabric.model_of(t)) for t in fabric.thread_list]
    return np.ascontiguousarray(rows, dtype=precision)


def thread_row(
    thread: Thread, name: str, entries: int = column.TRANSMISSION_ENTRIES
) -> NDArray[np.float64]:
    """(COLUMNS,) float64 row of one thread evaluated by the model called `name`; see `columns`.

    entries : of the model's tables that are computed; the others are interpolated
    """
    model = named(name)
    row = np.zeros(column.COLUMNS)
    albedo = np.minimum(np.array(thread.albedo), model.most_albedo)
    row[column.ALBEDO_R : column.ALBEDO_B + 1] = albedo
    row[column.BRIGHTNESS] = albedo.mean()
    row[column.MODEL], row[column.LAW] = MODELS.index(name), model.law
    ior = min(thread.ior, LARGEST_IOR)
    row[column.IOR_EXCESS] = (ior - 1.0) * (ior + 1.0)
    row[column.ISOTROPIC] = thread.isotropic
    row[column.SURFACE_GAIN] = thread.surface_gain
    gs, gv = max(thread.gamma_surface, NARROWEST), max(thread.gamma_volume, NARROWEST)
    row[column.GAMMA_SURFACE], row[column.GAMMA_VOLUME] = gs, gv
    row[column.SURFACE_WIDTH], row[column.VOLUME_WIDTH] = model.widths(gs, gv)
    for first, deviation in ((column.SURFACE_LOBE, gs), (column.VOLUME_LOBE, gv)):
        row[first : first + 2] = model.lobe_constants(deviation)
    if model.transmission is not None:
        through = model.transmission(thread, entries)
        _fill(row, column.TRANSMISSION, through)
        # A surface that reflects everything transmits nothing; T/T_max is then 0 instead of 0/0.
        largest = float(through.max())
        row[column.INVERSE_T_MAX] = 1.0 / largest if largest > 0 else 0.0
    if model.completion is not None:
        lost, norm = model.completion(thread, entries)
        row[column.COMPLETION_SCALE] = scale = (2.0 * math.pi * norm) ** 0.5
        _fill(row, column.COMPLETION, lost / scale if scale > 0 else lost)
    return row


def _fill(row: NDArray[np.float64], first: int, entries: NDArray[np.float64]) -> None:
    """Write a table of TRANSMISSION_ENTRIES values, the last one twice."""
    row[first : first + len(entries)] = entries
    row[first + len(entries)] = entries[-1]

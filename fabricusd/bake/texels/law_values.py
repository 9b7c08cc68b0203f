"""Evaluate the surface law of any fabric on threads at given tangent angles, as level `weave` does.

At that level the radiance depends on a place only through its thread and tangent angle. Tables by
thread and angle therefore hold everything that the baker needs of the law.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.law import PUBLISHED_ONLY, SurfaceLaw, law_value
from fabricusd.appearance.levels import WEAVE
from fabricusd.appearance.surface import points_all
from fabricusd.appearance.weave.place import Places, place_at
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import BLOCK, KERNEL

Floats = NDArray[np.float64]


def law_values(
    law: SurfaceLaw, thread_set: int, thread: int, psi0: Floats, wi: Floats, wo: Floats
) -> Floats:
    """(3, n) radiance per unit `L_i dwi` of level `weave` on one thread, cosine included.

    law : in float64
    psi0 : (n,) tangent angles [rad]
    wi, wo : (3, n) unit vectors in the weave's frame. A `conserving` thread also takes light from
        below the cloth.
    """
    n = len(psi0)
    places = Places(
        np.full(n, thread_set, np.uint8), np.full(n, thread, np.int32),
        np.ascontiguousarray(psi0, np.float64), np.zeros(n),
    )  # fmt: skip
    wi, wo = np.ascontiguousarray(wi), np.ascontiguousarray(wo)
    real: Any = np.float64
    out = np.empty_like(wi)
    if law.kind == PUBLISHED_ONLY:
        points_all(real, law.published, False, places, wi, wo, out)
    else:
        _all_values(real, *law, places, wi, wo, out)
    return out


# numba's parallel loops cannot take a tuple of tuples, so the law is passed in parts.
@njit(**KERNEL, parallel=True)
def _all_values(R, kind, a, b, c, d, places, wi, wo, out):  # type: ignore[no-untyped-def]
    n = wi.shape[1]
    for chunk in prange((n + BLOCK - 1) // BLOCK):
        first, last = chunk * BLOCK, min(n, (chunk + 1) * BLOCK)
        _some_values(R, SurfaceLaw(kind, a, b, c, d), places, wi, wo, out, first, last)


@njit(**KERNEL)
def _some_values(R, law, places, wi, wo, out, first, last):  # type: ignore[no-untyped-def]
    for k in range(first, last):
        out[0, k], out[1, k], out[2, k] = law_value(
            R, law, WEAVE, place_at(places, k),
            wi[0, k], wi[1, k], wi[2, k], wo[0, k], wo[1, k], wo[2, k],
        )  # fmt: skip


def painted(fabric: Fabric, albedo: float) -> Fabric:
    """The fabric with every thread's `A` replaced by one number."""
    threads = {n: replace(t, albedo=(albedo,) * 3) for n, t in fabric.threads.items()}
    return replace(fabric, threads=threads)

"""Named tuples for places of the weave, which the kernels of both laws take as one argument.

numba passes the fields of a named tuple separately, so the tuples cost nothing.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.weave.coverage import WEFT
from fabricusd.kernels.real import INLINE

Reals = NDArray[Any]


class Place(NamedTuple):
    """A point of a thread, as the surface laws see it; `real` is the precision of the law.

    thread_set : int - WEFT, WARP or GAP
    thread : int - index into `Fabric.threads`
    psi0 : real - tangent angle [rad]
    w : real - position across the visible width, in [-1, 1]; read at level `thread` only
    """

    thread_set: int
    thread: int
    psi0: Any
    w: Any


NOWHERE = Place(WEFT, 0, 0.0, 0.0)
"""In place of a point at level `far`, which reads none; in float64."""


class Places(NamedTuple):
    """The `Place` under each of n points.

    sets : (n,) uint8 or int32; threads : (n,) int32; psi0, w : (n,) real
    """

    sets: NDArray[Any]
    threads: NDArray[np.int32]
    psi0: Reals
    w: Reals


@njit(**INLINE)
def place_at(places, k):
    """The `Place` of entry k."""
    return Place(places.sets[k], places.threads[k], places.psi0[k], places.w[k])


class Hit(NamedTuple):
    """A point on a visible run of a thread, as the shadowing methods see it.

    thread_set, thread, w : see `Place`
    s : real - position along the visible run, in [0, 1)
    length : real - length of the visible run [m]
    """

    thread_set: int
    thread: int
    s: Any
    w: Any
    length: Any

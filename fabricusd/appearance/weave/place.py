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
    shade : real - factor of the thread's albedo
    """

    thread_set: int
    thread: int
    psi0: Any
    w: Any
    shade: Any = 1.0


NOWHERE = Place(WEFT, 0, 0.0, 0.0, 1.0)
"""In place of a point at level `far`, which reads none; in float64."""


EVEN: Reals = np.empty(0)
"""In place of the shades of threads that have one shade everywhere."""


class Places(NamedTuple):
    """The `Place` under each of n points.

    sets : (n,) uint8 or int32; threads : (n,) int32; psi0, w : (n,) real; shade : (n,) real, or
        (0,) for 1 everywhere
    """

    sets: NDArray[Any]
    threads: NDArray[np.int32]
    psi0: Reals
    w: Reals
    shade: Reals = EVEN


@njit(**INLINE)
def place_at(places, k):
    """The `Place` of entry k."""
    shade = float(places.shade[k]) if places.shade.size > 0 else 1.0
    return Place(places.sets[k], places.threads[k], places.psi0[k], places.w[k], shade)


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

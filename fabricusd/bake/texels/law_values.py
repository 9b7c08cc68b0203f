"""Evaluate the surface law of any fabric on threads at given tangent angles, as level `weave` does.

At that level the radiance depends on a place only through its thread and tangent angle. Tables by
thread and angle therefore hold everything that the baker needs of the law. Under a law that does
not mask, the values hold the mean of the shadow over all places with that angle, as level `far`
does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.fuzz import Fuzz, fuzz_over_all
from fabricusd.appearance.law import PUBLISHED_ONLY, SurfaceLaw, law_value, surface_law
from fabricusd.appearance.laws import law_of
from fabricusd.appearance.laws.lit import column_of
from fabricusd.appearance.levels import WEAVE
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.shadow.kinds import Shadow
from fabricusd.appearance.shadow.mean import angle_groups, level_of, mean_over
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.surface import evaluate, fuzz_of, places_of, points_all
from fabricusd.appearance.weave.coverage import GAP, WARP, WEFT
from fabricusd.appearance.weave.place import Places, place_at
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import BLOCK, KERNEL

Floats = NDArray[np.float64]

ANGLE_STEP = math.radians(0.25)
"""Steps of the tangent angle [rad] in which `LawAtPlaces` evaluates a law with a mean shadow."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ClothLaw:
    """The surface law of a fabric in float64, and what holds light back under it.

    shadow : None where the law masks
    fuzz : None where no thread is hairy
    """

    law: SurfaceLaw
    fabric: Fabric
    shadow: Shadow | None
    fuzz: Fuzz | None

    @property
    def linear(self) -> bool:
        """Whether the volume term is proportional to `A`: under all laws but `conserving`, if no
        fuzz hands light back and forth."""
        return self.law.kind == PUBLISHED_ONLY and self.fuzz is None


@lru_cache(maxsize=8)
def cloth_law(fabric: Fabric, albedo: float | None = None, *, multiple: bool = True) -> ClothLaw:
    """The law of `fabric`; albedo : replaces every thread's `A`, and changes nothing else.

    multiple : whether `conserving` cloth scatters light more than once
    """
    worn = fabric if albedo is None else painted(fabric, albedo)
    shadow = _held_back(fabric)
    law = surface_law(worn, precision=np.float64, multiple=multiple, shadow=shadow)
    if shadow is not None and albedo is not None:
        # The divisor against too bright views is that of the cloth, not of the replacement.
        whole: Any = surface_tables(fabric, precision=np.float64, shadow=shadow)
        law = law._replace(published=law.published._replace(excess=whole.excess))
    return ClothLaw(law=law, fabric=fabric, shadow=shadow, fuzz=fuzz_of(worn, np.float64))


@lru_cache(maxsize=4)
def _held_back(fabric: Fabric) -> Shadow | None:
    if not law_of(fabric).absolute:
        return None
    return compile_shadow(fabric, "horizon", precision=np.float64)


def law_values(
    cloth: ClothLaw, thread_set: int, thread: int, psi0: Floats, wi: Floats, wo: Floats
) -> Floats:
    """(3, n) radiance per unit `L_i dwi` of level `weave` on one thread, cosine included.

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
    out, law = np.empty_like(wi), cloth.law
    if law.kind == PUBLISHED_ONLY:
        points_all(real, law.published, False, places, wi, wo, out)
    else:
        _all_values(real, *law, places, wi, wo, out)
    _shade(cloth, thread_set, thread, np.asarray(psi0), wi, out)
    if cloth.fuzz is not None:
        row = np.array([-1 if thread_set == GAP else thread])
        fuzz_over_all(real, *cloth.fuzz, row, wi, wo, out)
    return out


class LawAtPlaces:
    """Level `weave` at places of the weave, with the mean of the shadow as in `law_values`.

    fabric, uv : the fabric, and weave coordinates (n, 2)
    """

    def __init__(self, fabric: Fabric, uv: Floats) -> None:
        self.fabric, self.uv = fabric, uv
        self.cloth = cloth_law(fabric)
        self.parts: list[tuple[int, int, NDArray[np.int64], Floats, NDArray[np.int64]]] = []
        shadow = self.cloth.shadow
        if shadow is None:
            return
        hit = places_of(fabric, uv)
        for which in (WEFT, WARP):
            for kind in np.flatnonzero(shadow.absolute):
                mine = np.flatnonzero((hit.set == which) & (hit.thread == kind))
                steps, number = np.unique(
                    np.round(hit.angle[mine] / ANGLE_STEP), return_inverse=True
                )
                self.parts.append((which, int(kind), mine, steps * ANGLE_STEP, number))

    def values(self, wi: Floats, wo: Floats) -> Floats:
        """(n, 3) radiance per unit `L_i dwi` for one pair of directions, (3,) and (3,)."""
        shadow = self.cloth.shadow
        if shadow is not None and shadow.all_absolute:
            out = np.zeros((len(self.uv), 3))
        else:
            light = np.repeat(wi[None], len(self.uv), axis=0)
            out = evaluate(self.fabric, light, wo, self.uv, "weave")
        for which, kind, mine, angles, number in self.parts:
            i, o = (np.repeat(w[:, None], len(angles), axis=1) for w in (wi, wo))
            out[mine] = law_values(self.cloth, which, kind, angles, i, o).T[number]
        return out


def _shade(
    cloth: ClothLaw, thread_set: int, thread: int, psi0: Floats, wi: Floats, out: Floats
) -> None:
    """Multiply out (3, n) by the mean of g at the tangent angles psi0 (n,), under its law."""
    if cloth.shadow is None or not cloth.shadow.absolute[thread]:
        return
    angles, number = np.unique(psi0, return_inverse=True)
    groups = _groups(cloth.fabric, thread_set, thread, angles.tobytes())
    real: Any = np.float64
    softness = float(cloth.shadow.softness)
    _hold_back(real, groups.reshape(-1), groups.shape, softness, number, wi, out)


@lru_cache(maxsize=8)
def _groups(fabric: Fabric, thread_set: int, thread: int, angles: bytes) -> Floats:
    """`angle_groups` of float64 angles, which tables ask for again and again: 12 MB of 721."""
    return angle_groups(_held_back(fabric), fabric, thread_set, thread, np.frombuffer(angles))


@njit(**KERNEL, parallel=True)
def _hold_back(R, horizons, shape, softness, number, wi, out):  # type: ignore[no-untyped-def]
    """Multiply out (3, n) by the mean of g at the angles `number` (n,).

    horizons : of `angle_groups`, flat; shape : (columns + 1, angles, groups)
    """
    columns, step, groups = shape[0] - 1, shape[1] * shape[2], shape[2]
    for k in prange(out.shape[1]):
        if wi[2, k] <= R(0):
            continue
        column, c = column_of(R, columns, wi[0, k], wi[1, k])
        here = column * step + number[k] * groups
        level = level_of(R, wi[2, k], softness)
        g = mean_over(R, horizons, groups, here, here + step, c, level)
        for channel in range(3):
            out[channel, k] *= g


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

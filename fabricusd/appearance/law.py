"""Evaluate and sample the surface law of a fabric, for the path tracer and the public functions.

A cloth may mix published and `conserving` threads. Each kind then scatters by its own law, masked
and shadowed by all threads; the values add up, and directions are drawn from both samplers with
equal probability. The kernels are scalar and take the precision `R` first. A value is the radiance
per unit `L_i dwi`, cosine included.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from fabricusd.appearance.conserving.levels import conserving_level_value
from fabricusd.appearance.conserving.multiple import (
    conserving_tables,
    conserving_value,
)
from fabricusd.appearance.conserving.shares import conserving_mixture
from fabricusd.appearance.conserving.single import (
    ConservingTables,
    single_tables,
)
from fabricusd.appearance.frame import WARP
from fabricusd.appearance.levels import FAR, THREAD
from fabricusd.appearance.published.far import far_value
from fabricusd.appearance.published.levels import point_value
from fabricusd.appearance.published.shares import published_mixture
from fabricusd.appearance.published.tables import SurfaceTables, surface_tables
from fabricusd.appearance.sampling.fit import no_mixture
from fabricusd.appearance.sampling.mixture import (
    Mixture,
    density,
    direction,
    point_density,
    point_direction,
)
from fabricusd.appearance.scattering.models import any_conserving, any_published
from fabricusd.appearance.shadow.kinds import Shadow
from fabricusd.appearance.weave.quadrature import Rule
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import PART

PUBLISHED_ONLY, CONSERVING_ONLY, MIXED = 0, 1, 2
"""Values of `SurfaceLaw.kind`."""


class SurfaceLaw(NamedTuple):
    """All tables of one fabric's surface law, in one precision.

    kind : int - PUBLISHED_ONLY, CONSERVING_ONLY or MIXED; tables that this kind does not use are
        empty
    published, lobes : tables of the threads with a published model, and their sampler
    conserving, conserving_lobes : tables of the `conserving` threads, and their sampler
    """

    kind: int
    published: SurfaceTables
    lobes: Mixture
    conserving: ConservingTables
    conserving_lobes: Mixture


def surface_law(
    fabric: Fabric,
    *,
    precision: type[np.floating[Any]] = np.float32,
    rule: Rule | None = None,
    multiple: bool = True,
    shadow: Shadow | None = None,
) -> SurfaceLaw:
    """The law of `fabric` in `precision`, np.float32 or np.float64.

    rule : quadrature over the curves; None takes the default of each model
    multiple : whether `conserving` cloth scatters light more than once; its table takes a second to
        compute
    shadow : the shadowing whose mean level `far` holds under a law that does not mask, or None
    """
    kind = PUBLISHED_ONLY
    if any_conserving(fabric):
        kind = MIXED if any_published(fabric) else CONSERVING_ONLY
    published = surface_tables(fabric, precision=precision, rule=rule, shadow=shadow)
    lobes = no_mixture(precision)
    if kind != CONSERVING_ONLY:
        lobes = published_mixture(fabric, published)
    if kind == PUBLISHED_ONLY:
        conserving = single_tables(fabric, precision=precision, rule=rule)
        both = no_mixture(precision, sides=2, cosines=1)
    else:
        conserving = conserving_tables(fabric, precision=precision, multiple=multiple, rule=rule)
        both = conserving_mixture(fabric, conserving)
    return SurfaceLaw(kind, published, lobes, conserving, both)


@njit(**PART)
def law_value(R, law, level, place, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """(r, g, b) of the surface law at a level; place : a `Place`, not read at level FAR."""
    red, green, blue = R(0), R(0), R(0)
    if law.kind != CONSERVING_ONLY:
        if level == FAR:
            red, green, blue = far_value(R, law.published, ix, iy, iz, ox, oy, oz)
        elif place.thread_set < 2:
            red, green, blue = point_value(
                R, law.published, level == THREAD, place, ix, iy, iz, ox, oy, oz
            )
    if law.kind != PUBLISHED_ONLY:
        r, g, b = R(0), R(0), R(0)
        if level == FAR:
            r, g, b = conserving_value(R, law.conserving, ix, iy, iz, ox, oy, oz)
        else:
            r, g, b = conserving_level_value(
                R, law.conserving, level == THREAD, place, ix, iy, iz, ox, oy, oz
            )
        red, green, blue = red + r, green + g, blue + b
    return red, green, blue


@njit(**PART)
def law_density(R, law, level, place, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """pdf(wi) [1/sr] of `law_direction`; 0 for directions that it never draws."""
    p, q = R(0), R(0)
    if law.kind != CONSERVING_ONLY:
        if level == FAR:
            p = density(R, law.lobes, ix, iy, iz, ox, oy, oz)
        else:
            p = point_density(
                R, law.published.threads, law.lobes, level == THREAD, place, ix, iy, iz, ox, oy, oz
            )
    if law.kind != PUBLISHED_ONLY:
        # In a gap, what does not pass is scattered as by the whole repeat.
        if level == FAR or place.thread_set > WARP:
            q = density(R, law.conserving_lobes, ix, iy, iz, ox, oy, oz)
        else:
            q = point_density(
                R, law.conserving.threads, law.conserving_lobes, level == THREAD, place,
                ix, iy, iz, ox, oy, oz,
            )  # fmt: skip
    # The published models are 0 for a viewer below the cloth: the conserving sampler draws all
    # directions there.
    if law.kind == MIXED and oz > R(0):
        return R(0.5) * (p + q)
    return q if law.kind != PUBLISHED_ONLY else p


@njit(**PART)
def law_direction(R, law, level, place, ox, oy, oz, u0, u1, u2):  # type: ignore[no-untyped-def]
    """wi (x, y, z) for a viewer and three numbers in [0, 1).

    Callers must reject a direction whose `law_density` is 0.
    """
    published = law.kind == PUBLISHED_ONLY
    if law.kind == MIXED and oz > R(0):
        published = u0 < R(0.5)
        u0 = R(2) * u0 if published else R(2) * u0 - R(1)
    if published:
        if level == FAR:
            return direction(R, law.lobes, ox, oy, oz, u0, u1, u2)
        return point_direction(
            R, law.published.threads, law.lobes, level == THREAD, place, ox, oy, oz, u0, u1, u2
        )
    if level == FAR or place.thread_set > WARP:
        return direction(R, law.conserving_lobes, ox, oy, oz, u0, u1, u2)
    return point_direction(
        R, law.conserving.threads, law.conserving_lobes, level == THREAD, place,
        ox, oy, oz, u0, u1, u2,
    )  # fmt: skip

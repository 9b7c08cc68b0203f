"""Importance sampling of cloth: the mixture of lobes that all surface laws use.

Part of the directions are uniform over the sphere or the hemisphere. The others are drawn from the
lobes of `lobes`, THREAD_LOBES for each of the `stretches` of tangent angle, and from cosine lobes
about the cloth's normal, which represent light scattered more than once. `fit` measures the shares
of the lobes for a grid of views, once per fabric. At a point of the weave only the lobes of the
thread under the point are used.

Below the cloth, a lobe draws the directions of the lobe above, negated, around the mirror
inclination of that side. A viewer below the cloth is equivalent to one above with both directions
negated; a law that has this symmetry uses a mixture of two sides. A mixture of one side draws
nothing below the cloth and has no viewers there.

Source: `docs/model.md` section 6. The kernels are scalar and take the precision `R` first; `blocks`
does the same for many hits at a time.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.frame import from_thread, to_thread
from fabricusd.appearance.sampling.across import narrow_direction, narrower
from fabricusd.appearance.sampling.lobes import (
    STEEPEST,
    SURFACE,
    THREAD_LOBES,
    lobe_densities,
    narrowed,
    sample_lobe,
)
from fabricusd.appearance.sampling.stretches import Stretch, nearest_stretch, stretch_of
from fabricusd.appearance.sampling.views import share_at, uniform_direction, view_corner
from fabricusd.appearance.scattering import columns
from fabricusd.appearance.weave.coverage import WARP
from fabricusd.kernels.real import INLINE, PART, atan2, cos, sin
from fabricusd.kernels.unrolled import sum_of_products, tuple_of

Reals = NDArray[Any]
_GAMMA, _ON_SURFACE, _ON_VOLUME = (
    columns.GAMMA_SURFACE, columns.SURFACE_WIDTH, columns.VOLUME_WIDTH,
)  # fmt: skip


class Mixture(NamedTuple):
    """The tables of the sampler; `real` is the precision of the law.

    stretches : (s, STRETCH_COLUMNS) real - see `stretches_of`
    shares : (ELEVATIONS, AZIMUTHS, lobes) real - shares of the lobes at level `far`, in this order:
        THREAD_LOBES of every stretch, above the cloth and then below, then the cosine lobes above
        and below; a mixture of one side has none below. They sum to 1 - even at each view
    point_shares : (ELEVATIONS, AZIMUTHS, s lobes) real - shares at a point of each stretch, in the
        same order and with the same sum
    even : real - share of directions that are uniform over the sphere or the upper hemisphere; it
        bounds the weight of directions that no lobe covers
    sides : int - 1 or 2
    opaque : int - 1 if no direction is drawn on the side opposite the viewer
    cosines : int - 1 if there are cosine lobes
    """

    stretches: Reals
    shares: Reals
    point_shares: Reals
    even: Any
    sides: int
    opaque: int
    cosines: int


def count_lobes(stretches: int, sides: int, cosines: int) -> int:
    """Number of lobes of a mixture in `shares`; with one stretch, the number at a point."""
    return sides * (THREAD_LOBES * stretches + cosines)


@njit(**INLINE)
def even_density(R, mixture, iz):
    """Density [1/sr] of the uniform part, for a viewer above the cloth."""
    if mixture.opaque != 0:
        return R(0.5 / math.pi) if iz > R(0) else R(0)
    return R(0.25 / math.pi)


@njit(**INLINE)
def even_direction(R, mixture, u0, u1, u2):
    """A direction of the uniform part; u0 : in [0, even)."""
    x, y, z = uniform_direction(R, u1, u2)
    if mixture.opaque == 0 and u0 < R(0.5) * mixture.even:
        return -x, -y, -z
    return x, y, z


@njit(**INLINE)
def stretch_densities(R, stretch, ix, iy, iz, ox, oy, oz):
    """Densities [1/sr] of a `Stretch`'s lobes on the side of wi, for a viewer above."""
    c, s = stretch.cos, stretch.sin
    turn = R(1) if iz > R(0) else R(-1)
    t, b, n = to_thread(R, stretch.thread_set, c, s, turn * ix, turn * iy, turn * iz)
    t_o, b_o, n_o = to_thread(R, stretch.thread_set, c, s, ox, oy, oz)
    theta_o = turn * atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    found = lobe_densities(R, stretch, theta_o, t, b, max(n, R(1e-12)))
    # The density is 0 behind the thread; a product instead of a branch lets LLVM vectorise loops.
    return _times(R, R(1) if n > R(0) else R(0), found)


@njit(**INLINE)
def _product(R, k, factor, numbers):
    return factor * numbers[k]


@njit(**INLINE)
def _share(R, k, shares, corner, first):
    return share_at(R, shares, corner, first + k)


_times = tuple_of(_product, THREAD_LOBES)
_thread_shares = tuple_of(_share, THREAD_LOBES)
mixed = sum_of_products(THREAD_LOBES)


@njit(**PART)
def density(R, mixture, ix, iy, iz, ox, oy, oz):
    """pdf(wi) [1/sr] of `direction`, at level `far`; 0 at the horizon and where it never draws."""
    if iz == R(0) or oz == R(0) or (mixture.sides == 1 and min(iz, oz) < R(0)):
        return R(0)
    if oz < R(0):
        ix, iy, iz, ox, oy, oz = -ix, -iy, -iz, -ox, -oy, -oz
    even = even_density(R, mixture, iz)
    if even == R(0):
        return even
    corner = view_corner(R, ox, oy, oz)
    lobes = THREAD_LOBES * mixture.stretches.shape[0]
    side = 0 if iz > R(0) else 1
    p = mixture.even * even
    if mixture.cosines != 0:
        share = share_at(R, mixture.shares, corner, mixture.sides * lobes + side)
        p += share * abs(iz) * R(1 / math.pi)
    for y in range(mixture.stretches.shape[0]):
        stretch = stretch_of(mixture.stretches[y])
        found = stretch_densities(R, stretch, ix, iy, iz, ox, oy, oz)
        first = side * lobes + THREAD_LOBES * y
        p += mixed(_thread_shares(R, mixture.shares, corner, first), found)
    return p


@njit(**INLINE)
def _choose(R, shares, corner, first, count, left):
    """The lobe out of `count`, whose shares start at `first`, that `left` selects."""
    k = 0
    while k < count - 1:
        left -= share_at(R, shares, corner, first + k)
        if left < R(0):
            break
        k += 1
    return k


@njit(**INLINE)
def _drawn_lobe(mixture, stretches, k):
    """Lobe `k`, or the upper cosine lobe if `k` is the lower one and the cloth is opaque.

    The share of that lower lobe is 0, so it can only be selected through rounding.
    """
    cosine = mixture.sides * THREAD_LOBES * stretches
    if mixture.opaque != 0 and mixture.sides == 2 and k > cosine:
        return cosine
    return k


@njit(**PART)
def direction(R, mixture, ox, oy, oz, u0, u1, u2):
    """wi (x, y, z) at level `far`, for a viewer and three numbers in [0, 1)."""
    flip = R(-1) if oz < R(0) and mixture.sides == 2 else R(1)
    ox, oy, oz = flip * ox, flip * oy, flip * oz
    left = u0 - mixture.even
    count = mixture.shares.shape[2]
    if left < R(0) or count == 0:
        x, y, z = even_direction(R, mixture, u0, u1, u2)
        return flip * x, flip * y, flip * z
    corner = view_corner(R, ox, oy, oz)
    k = _choose(R, mixture.shares, corner, 0, count, left)
    k = _drawn_lobe(mixture, mixture.stretches.shape[0], k)
    x, y, z = lobe_direction(R, mixture, k, ox, oy, oz, u1, u2)
    return flip * x, flip * y, flip * z


@njit(**INLINE)
def lobe_direction(R, mixture, k, ox, oy, oz, u1, u2):
    """A direction of lobe k, in the order of `shares`, for a viewer above the cloth."""
    lobes = THREAD_LOBES * mixture.stretches.shape[0]
    if k >= mixture.sides * lobes:
        below = k > mixture.sides * lobes
        x, y, z = uniform_direction(R, math.sqrt(u1), u2)
        turn = R(-1) if below else R(1)
        return turn * x, turn * y, turn * z
    stretch = stretch_of(mixture.stretches[(k % lobes) // THREAD_LOBES])
    return _stretch_direction(R, k % THREAD_LOBES, k >= lobes, stretch, ox, oy, oz, u1, u2)


@njit(**INLINE)
def _stretch_direction(R, lobe, below, stretch, ox, oy, oz, u1, u2):
    """A direction of a lobe of a `Stretch`, above the cloth or below it."""
    c, s = stretch.cos, stretch.sin
    turn = R(-1) if below else R(1)
    t_o, b_o, n_o = to_thread(R, stretch.thread_set, c, s, ox, oy, oz)
    theta_o = turn * atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    t, b, n = sample_lobe(R, lobe, stretch, theta_o, u1, u2)
    x, y, z = from_thread(R, stretch.thread_set, c, s, t, b, n)
    return turn * x, turn * y, turn * z


@njit(**INLINE)
def _stretch_at(R, threads, place):
    """The `Stretch` of the thread at a `Place`, with lobes as wide as the thread's own."""
    psi0 = min(max(place.psi0, R(-STEEPEST)), R(STEEPEST))
    c, s = cos(R, psi0), sin(R, psi0)
    row = threads[place.thread]
    return Stretch(place.thread_set, psi0, c, s, s / c, row[_ON_SURFACE], row[_ON_VOLUME])


@njit(**PART)
def point_density(R, threads, mixture, across_too, place, ix, iy, iz, ox, oy, oz):
    """pdf(wi) [1/sr] of `point_direction`; 0 at the horizon and where it never draws.

    threads : rows of `pack_threads`; place : a `Place`
    """
    if iz == R(0) or oz == R(0) or (mixture.sides == 1 and min(iz, oz) < R(0)):
        return R(0)
    # The position across the thread narrows the lobe if viewer and light are both on the front.
    narrow = across_too and oz > R(0) and iz > R(0)
    if oz < R(0):
        ix, iy, iz, ox, oy, oz = -ix, -iy, -iz, -ox, -oy, -oz
    even = even_density(R, mixture, iz)
    if place.thread_set > WARP or even == R(0) or mixture.stretches.shape[0] == 0:
        return even
    stretch = _stretch_at(R, threads, place)
    found = stretch_densities(R, stretch, ix, iy, iz, ox, oy, oz)
    if narrow:
        gamma = threads[place.thread, _GAMMA]
        found = narrowed(found, narrower(R, gamma, stretch, place.w, ix, iy, iz, ox, oy, oz))
    corner = view_corner(R, ox, oy, oz)
    first = _first_at(R, mixture, place, stretch.psi0)
    side = 0 if iz > R(0) else 1
    p = mixture.even * even
    if mixture.cosines != 0:
        k = first + mixture.sides * THREAD_LOBES + side
        p += share_at(R, mixture.point_shares, corner, k) * abs(iz) * R(1 / math.pi)
    shares = _thread_shares(R, mixture.point_shares, corner, first + THREAD_LOBES * side)
    return p + mixed(shares, found)


@njit(**INLINE)
def _lobes_at(mixture):
    """Number of lobes at a point."""
    return mixture.sides * (THREAD_LOBES + mixture.cosines)


@njit(**INLINE)
def _first_at(R, mixture, place, psi0):
    """Index into `point_shares` of the first lobe of the stretch that a tangent angle is in."""
    stretch = nearest_stretch(R, mixture.stretches, place.thread_set, place.thread, psi0)
    return _lobes_at(mixture) * stretch


@njit(**PART)
def point_direction(R, threads, mixture, across_too, place, ox, oy, oz, u0, u1, u2):
    """wi (x, y, z) at level `weave`, or `thread` if `across_too`; uniform in a gap."""
    flip = R(-1) if oz < R(0) and mixture.sides == 2 else R(1)
    ox, oy, oz = flip * ox, flip * oy, flip * oz
    gap = place.thread_set > WARP or mixture.stretches.shape[0] == 0
    left = u0 - mixture.even
    if gap or left < R(0):
        x, y, z = even_direction(R, mixture, u0 * mixture.even if gap else u0, u1, u2)
        return flip * x, flip * y, flip * z
    stretch = _stretch_at(R, threads, place)
    corner = view_corner(R, ox, oy, oz)
    first = _first_at(R, mixture, place, stretch.psi0)
    k = _choose(R, mixture.point_shares, corner, first, _lobes_at(mixture), left)
    k = _drawn_lobe(mixture, 1, k)
    if across_too and flip > R(0) and k == SURFACE:
        gamma = threads[place.thread, _GAMMA]
        return narrow_direction(R, gamma, stretch, place.w, ox, oy, oz, u1, u2)
    if k >= mixture.sides * THREAD_LOBES:
        x, y, z = uniform_direction(R, math.sqrt(u1), u2)
        turn = flip if k == mixture.sides * THREAD_LOBES else -flip
        return turn * x, turn * y, turn * z
    x, y, z = _stretch_direction(
        R, k % THREAD_LOBES, k >= THREAD_LOBES, stretch, ox, oy, oz, u1, u2
    )
    return flip * x, flip * y, flip * z

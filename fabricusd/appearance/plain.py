"""The reference implementation of the appearance model, against which the kernels are tested.

It follows the formulas of `docs/model.md` in slow, plain float64 NumPy and shares no code with the
kernels. The formula of a thread is in the module of its model, beside the kernels. Directions are
(n, 3) unit vectors; every function broadcasts over n. Source: MODEL sections 1, 2 and 4
(`docs/model.md`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fabricusd.appearance.laws import law_of
from fabricusd.appearance.scattering.models import named
from fabricusd.appearance.scattering.plain_lobes import Angles, Array, angles, wrap
from fabricusd.appearance.weave.coverage import WARP, WEFT, coverage
from fabricusd.fabric import PILE_ANGLE, Fabric, TangentCurve, Thread

NOTHING = 1e-12
"""A published surface law is 0 where its total is at or below this."""


def to_thread(w: Array, is_warp: bool, psi0: float | Array) -> Array:
    """(n, 3) directions of the surface frame (U, V, N) in the frame of a thread at `psi0` [rad].

    Warp runs along V, weft along U; `t = cos psi0 a - sin psi0 N`, `b = n_t x t`.
    """
    w = np.asarray(w, np.float64)
    along = w[..., 1] if is_warp else w[..., 0]
    b = -w[..., 0] if is_warp else w[..., 1]
    c, s = np.cos(psi0), np.sin(psi0)
    return np.stack((c * along - s * w[..., 2], b, s * along + c * w[..., 2]), axis=-1)


def thread_terms(thread: Thread, model: str, i: Angles, o: Angles) -> tuple[Array, Array]:
    """Surface and volume term of `f_s` [1/sr], each (n,), the latter without `A`. Section 2."""
    return named(model).plain(thread, i, o)


def thread_value(thread: Thread, model: str, wi: Array, wo: Array) -> Array:
    """(n, 3) `f_s` [1/sr] without the cosine; directions are in the thread frame."""
    surface, volume = thread_terms(thread, model, angles(wi), angles(wo))
    return surface[..., None] + volume[..., None] * albedo_of(thread, model)


def albedo_of(thread: Thread, model: str) -> Array:
    """(3,) `A`, clamped to 1 for models in which it is an albedo."""
    return np.minimum(thread.albedo, named(model).most_albedo)


def curve_points(curve: TangentCurve, per_segment: int = 64) -> tuple[Array, Array]:
    """(psi0, weight), each (k,): midpoints by length. Weights sum to 1; jumps have no weight."""
    p, a = np.array(curve.positions), np.array(curve.angles)
    middle = (np.arange(per_segment) + 0.5) / per_segment
    psi0 = [a[k] + (a[k + 1] - a[k]) * middle for k in range(len(p) - 1) if p[k + 1] > p[k]]
    weight = np.diff(p)[np.diff(p) > 0] / (p[-1] - p[0])
    return np.concatenate(psi0), np.repeat(weight / per_segment, per_segment)


@dataclass(frozen=True, kw_only=True)
class Share:
    """A part of the cloth: one type of thread in one set, and the share of the area it covers."""

    thread: Thread
    model: str
    is_warp: bool
    area: float


def shares(fabric: Fabric) -> tuple[Share, ...]:
    """The share of the cloth that each type of thread covers in each set, if any. Section 3."""
    area = coverage(fabric).type_area
    return tuple(
        Share(
            thread=thread,
            model=fabric.model_of(thread),
            is_warp=j == WARP,
            area=float(area[j, k]),
        )
        for j in (WEFT, WARP)
        for k, thread in enumerate(fabric.thread_list)
        if area[j, k] > 0
    )


def _nodes(fabric: Fabric, per_segment: int) -> Iterator[tuple[Share, float, float]]:
    """(share, psi0, area) of every piece of visible thread."""
    for share in shares(fabric):
        for psi0, weight in zip(*curve_points(share.thread.curve, per_segment), strict=True):
            yield share, float(psi0), float(weight) * share.area


def gap(fabric: Fabric) -> float:
    """The share of the cloth that no thread covers."""
    return 1.0 - sum(share.area for share in shares(fabric))


def normalization(fabric: Fabric, wi: Array, wo: Array, per_segment: int = 64) -> Array:
    """(n,) The surface law's total of the sum of a <weight>."""
    law, seen = law_of(fabric), np.zeros(np.shape(wo)[:-1])
    for share, psi0, area in _nodes(fabric, per_segment):
        i = angles(to_thread(wi, share.is_warp, psi0))
        o = angles(to_thread(wo, share.is_warp, psi0))
        seen = seen + area * law.plain_weight(fabric, share.is_warp, psi0, i, o)
    return np.asarray(law.plain_total(fabric, seen, gap(fabric), np.asarray(wo)))


def segment(
    fabric: Fabric,
    share: Share,
    psi0: float | Array,
    wi: Array,
    wo: Array,
    width: Array | None = None,
) -> Array:
    """(n, 3) `weight f_s mask cos theta_i` of a segment of thread at `psi0`, before the division by
    the law's total.

    width : (n,) or None - `w` in [-1, 1] across the thread (level `thread`); None for the mean
    """
    i = angles(to_thread(wi, share.is_warp, psi0))
    o = angles(to_thread(wo, share.is_warp, psi0))
    surface, volume = thread_terms(share.thread, share.model, i, o)
    if width is not None:
        across_surface, across_volume = across(share.thread, i, o, width)
        surface, volume = surface * across_surface, volume * across_volume
    value = surface[..., None] + volume[..., None] * albedo_of(share.thread, share.model)
    law = law_of(fabric)
    visible = law.plain_weight(fabric, share.is_warp, psi0, i, o) * law.plain_mask(fabric, i, o)
    return np.asarray(value * (visible * np.cos(i.theta))[..., None])


def across(thread: Thread, i: Angles, o: Angles, w: Array) -> tuple[Array, Array]:
    """Factors (n,) of the surface and the volume term at `w` across the thread; the mean of each
    over w is 1."""
    # Importing SciPy takes as long as importing NumPy, and authoring does without it.
    from scipy.special import erf

    half = o.phi + 0.5 * wrap(i.phi - o.phi)
    h = np.where(np.abs(half) > math.pi / 2, np.sign(half), np.sin(half))
    beta = max(thread.gamma_surface, 0.1)
    root = beta * math.sqrt(2)
    z = beta * math.sqrt(2 * math.pi) / 4 * (erf((1 - h) / root) + erf((1 + h) / root))
    return np.exp(-((w - h) ** 2) / (2 * beta**2)) / z, 1 + w * (np.sin(i.phi) + np.sin(o.phi)) / 2


def _published(value: Array, q: Array, wi: Array, wo: Array) -> Array:
    """`value / Q`; 0 for directions at or below the cloth and where `Q` is at most NOTHING."""
    lit = (np.asarray(wi)[..., 2] > 0) & (np.asarray(wo)[..., 2] > 0) & (q > NOTHING)
    return np.where(lit[..., None], value / np.where(lit, q, 1.0)[..., None], 0.0)


def far(fabric: Fabric, wi: Array, wo: Array, per_segment: int = 64) -> Array:
    """(n, 3) radiance per unit `L_i dwi` of the published models at level `far`."""
    value = np.zeros((*np.shape(wi)[:-1], 3))
    for share, psi0, area in _nodes(fabric, per_segment):
        value = value + area * segment(fabric, share, psi0, wi, wo)
    return _published(value, normalization(fabric, wi, wo, per_segment), wi, wo)


def point(
    fabric: Fabric,
    share: Share,
    psi0: float | Array,
    wi: Array,
    wo: Array,
    width: Array | None = None,
    per_segment: int = 64,
) -> Array:
    """(n, 3) value at level `weave`, or `thread` given a `width`; psi0 : tangent angle [rad]."""
    value = segment(fabric, share, psi0, wi, wo, width)
    return _published(value, normalization(fabric, wi, wo, per_segment), wi, wo)


def conserving_far(
    fabric: Fabric, wi: Array, wo: Array, per_segment: int = 64, sides: Array | None = None
) -> Array:
    """(n, 3) single scattering of `conserving` cloth over the whole sphere, cosine included.

    sides : (2, rows, columns, 3) - `ConservingTables.sides` without the border, of which the first
        two entries are the factors of surface and volume; None for factors of 1
    """
    wi, wo = np.asarray(wi, np.float64), np.asarray(wo, np.float64)
    factors = np.ones((*wi.shape[:-1], 2))
    if sides is not None:
        own = (wi[..., 2] > 0) == (wo[..., 2] > 0)
        for w in (wi, wo):
            pair = [between_entries(table[..., :2], w) for table in sides]
            factors = factors * np.where(own[..., None], *pair)
    value = np.zeros((*wi.shape[:-1], 3))
    s_i, s_o = np.zeros(wi.shape[:-1]), np.zeros(wi.shape[:-1])
    for share, psi0, area in _nodes(fabric, per_segment):
        psi0 = float(np.clip(psi0, -PILE_ANGLE, PILE_ANGLE))
        ti, to = (to_thread(w, share.is_warp, psi0) for w in (wi, wo))
        mu_i = np.maximum(np.sign(wi[..., 2]) * ti[..., 2], 0)
        mu_o = np.maximum(np.sign(wo[..., 2]) * to[..., 2], 0)
        q = area / max(math.cos(psi0), math.cos(PILE_ANGLE))
        s_i, s_o = s_i + q * mu_i, s_o + q * mu_o
        surface, volume = thread_terms(share.thread, "conserving", angles(ti), angles(to))
        surface, volume = surface * factors[..., 0], volume * factors[..., 1]
        f_s = surface[..., None] + volume[..., None] * albedo_of(share.thread, "conserving")
        value = value + (q * mu_i * mu_o)[..., None] * f_s
    covered = 1.0 - gap(fabric)
    up_i, up_o = np.abs(wi[..., 2]), np.abs(wo[..., 2])
    with np.errstate(divide="ignore", invalid="ignore"):
        g_i, g_o = np.minimum(1, covered * up_i / s_i), np.minimum(1, covered * up_o / s_o)
        scale = g_i * g_o / up_o
    scale = np.where((up_i > 0) & (up_o > 0) & (s_i > 0) & (s_o > 0), scale, 0.0)
    return np.asarray(value * scale[..., None])


def between_entries(table: Array, w: Array) -> Array:
    """(n, k) entries of a (rows, columns, k) table by direction, at least 0; see
    `conserving.grid`."""
    rows, columns = table.shape[:2]
    w = np.where(w[..., 2:] < 0, -w, w)
    theta, phi = np.arccos(np.clip(w[..., 2], -1, 1)), np.arctan2(w[..., 1], w[..., 0])
    i = 2 / math.pi * np.arcsin(np.clip(2 / math.pi * theta, 0, 1)) * (rows - 1)
    j = phi * columns / (2 * math.pi)
    # Rows beyond the pole, which the opposite azimuth has, and beyond the horizon.
    beyond = np.roll(table[1:3][::-1], columns // 2, axis=1)
    whole = np.concatenate((beyond, table, table[-3:-1][::-1]))
    row, column = np.minimum(np.floor(i), rows - 2), np.floor(j)
    total = np.zeros((*w.shape[:-1], table.shape[2]))
    for a in range(-1, 3):
        for b in range(-1, 3):
            weight = _catmull_rom(i - row - a) * _catmull_rom(j - column - b)
            k, m = (row + a + 2).astype(int), (column + b).astype(int) % columns
            total += weight[..., None] * whole[k, m]
    return np.maximum(total, 0.0)


def _catmull_rom(x: Array) -> Array:
    """The kernel of Catmull-Rom interpolation at a distance of x entries."""
    x = np.abs(x)
    near, far = 1.5 * x**3 - 2.5 * x**2 + 1, -0.5 * x**3 + 2.5 * x**2 - 4 * x + 2
    return np.where(x < 1, near, np.where(x < 2, far, 0.0))


def white(fabric: Fabric, albedo: float = 1.0) -> Fabric:
    """`fabric` with `A` of every thread set to `albedo` in all channels."""
    threads = {k: replace(t, albedo=(albedo,) * 3) for k, t in fabric.threads.items()}
    return replace(fabric, threads=threads)

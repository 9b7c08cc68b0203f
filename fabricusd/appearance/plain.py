"""The appearance model as it is written down: slow, plain float64 NumPy, shared with no kernel.

What the compiled kernels are tested against. Directions are (n, 3) unit vectors; every function
broadcasts over n. Source: MODEL sections 1, 2 and 4 (`docs/model.md`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf, i0e

from fabricusd.appearance.weave.coverage import WARP, WEFT, coverage
from fabricusd.fabric import PILE_ANGLE, Fabric, TangentCurve, Thread

Array = NDArray[np.float64]

NOTHING = 1e-12
"""`Q` at or below which the published surface law is 0."""


@dataclass(frozen=True, kw_only=True)
class Angles:
    """One direction in a thread's frame (t, b, n_t): inclination and the two azimuths [rad].

    theta : (n,) - asin(w.t); phi : (n,) - atan2(w.b, w.n_t); psi : (n,) - atan2(w.t, w.n_t)
    """

    theta: Array
    phi: Array
    psi: Array


def azimuth(y: Array, x: Array) -> Array:
    """atan2(y, x) [rad] with atan2(0, 0) = 0 whatever the signs of the zeros."""
    return np.where((y == 0) & (x == 0), 0.0, np.arctan2(y, x))


def wrap(angle: Array) -> Array:
    """`angle` [rad] moved into (-pi, pi]."""
    return math.pi - np.mod(math.pi - angle, 2 * math.pi)


def angles(w: Array) -> Angles:
    """Of `w` : (n, 3) in the thread frame, x along `t`, y along `b`, z along `n_t`."""
    t, b, n = np.moveaxis(np.asarray(w, np.float64), -1, 0)
    return Angles(theta=np.arctan2(t, np.hypot(b, n)), phi=azimuth(b, n), psi=azimuth(t, n))


def to_thread(w: Array, is_warp: bool, psi0: float | Array) -> Array:
    """(n, 3) from the surface frame (U, V, N) to the frame of a thread at tangent angle `psi0`.

    Warp runs along V, weft along U; `t = cos psi0 a - sin psi0 N`, `b = n_t x t`.
    """
    w = np.asarray(w, np.float64)
    along = w[..., 1] if is_warp else w[..., 0]
    b = -w[..., 0] if is_warp else w[..., 1]
    c, s = np.cos(psi0), np.sin(psi0)
    return np.stack((c * along - s * w[..., 2], b, s * along + c * w[..., 2]), axis=-1)


def gaussian(s: float, x: Array) -> Array:
    """Unit-area Gaussian of standard deviation `s` [rad] at `x` [rad]."""
    return np.exp(-0.5 * (x / s) ** 2) / (s * math.sqrt(2 * math.pi))


def fresnel(ior: float, cosine: Array) -> Array:
    """Unpolarised reflectance of a dielectric at incidence cosine `cosine` in [0, 1]."""
    cosine = np.broadcast_to(cosine, np.shape(cosine))
    if ior == 1.0:
        return np.zeros_like(cosine)
    inside = np.sqrt(np.maximum(1 - (1 - cosine**2) / ior**2, 0))
    parallel = (ior * cosine - inside) / (ior * cosine + inside)
    perpendicular = (cosine - ior * inside) / (cosine + ior * inside)
    return 0.5 * (parallel**2 + perpendicular**2)


def longitudinal(a: Array, b: Array, s: float) -> Array:
    """`K(a, b; s)`, [dEon2011] eq. 7 without cancellation; its integral over cos b db is 1."""
    v = s * s
    peak = np.exp(-2 * np.sin(0.5 * (a + b)) ** 2 / v)
    return peak * i0e(np.cos(a) * np.cos(b) / v) / (v * -math.expm1(-2 / v))


def conserving_surface(thread: Thread, i: Angles, o: Angles) -> Array:
    """(n,) surface term of the `conserving` model [1/sr]."""
    cos_half = np.cos(0.5 * wrap(i.phi - o.phi))
    f = fresnel(thread.ior, np.cos(0.5 * (i.theta - o.theta)) * cos_half)
    k = longitudinal(i.theta, o.theta, 2 * thread.gamma_surface)
    widest = np.maximum(np.maximum(np.cos(i.theta), np.cos(o.theta)), 1e-6)
    return np.minimum(1, thread.surface_gain * f) * cos_half / 4 * k / widest


@lru_cache(maxsize=64)
def surface_albedo(thread: Thread, count: int = 181) -> tuple[Array, Array]:
    """(|theta|, E): directional albedo of the `conserving` surface term, clamped to 1."""
    theta = np.linspace(0, math.pi / 2, count)
    x, x_weight = np.polynomial.legendre.leggauss(200)
    y, y_weight = np.polynomial.legendre.leggauss(64)
    shape = (len(x), len(y))
    still = np.zeros(shape)
    o_phi = np.broadcast_to((y + 1) * math.pi / 2, shape)
    narrow = 2 * thread.gamma_surface
    albedo = np.empty(count)
    for k, t in enumerate(theta):
        # The nodes follow the lobe, which narrow threads squeeze between any fixed grid.
        lo, hi = max(-math.pi / 2, -t - 9 * narrow), min(math.pi / 2, -t + 9 * narrow)
        out = np.broadcast_to((lo + (hi - lo) * (x + 1) / 2)[:, None], shape)
        i = Angles(theta=np.full(shape, t), phi=still, psi=still)
        o = Angles(theta=out, phi=o_phi, psi=still)
        value = conserving_surface(thread, i, o) * np.cos(out) ** 2
        albedo[k] = x_weight @ value @ y_weight * math.pi * (hi - lo) / 2
    return theta, np.minimum(albedo, 1.0)


def thread_terms(thread: Thread, model: str, i: Angles, o: Angles) -> tuple[Array, Array]:
    """Surface and volume term of `f_s` [1/sr], each (n,), the volume's without `A`. Section 2."""
    ci, co = np.cos(i.theta), np.cos(o.theta)
    cos_half = np.cos(0.5 * wrap(i.phi - o.phi))
    theta_h, theta_d = 0.5 * (i.theta + o.theta), 0.5 * (i.theta - o.theta)
    if model == "conserving":
        table, albedo = surface_albedo(thread)
        widest = np.maximum(np.maximum(ci, co), 1e-6)
        kept = 1 - albedo
        t_i, t_o = np.interp(abs(i.theta), table, kept), np.interp(abs(o.theta), table, kept)
        k = longitudinal(i.theta, o.theta, 2 * thread.gamma_volume)
        lobe = (1 - thread.isotropic) * k / (2 * math.pi * widest)
        volume = t_i * t_o / kept.max() * (lobe + thread.isotropic / math.pi**2)
        return conserving_surface(thread, i, o), volume
    if model == "thesis":
        f = fresnel(thread.ior, np.cos(theta_h) * cos_half)
        transmitted = (1 - fresnel(thread.ior, ci)) * (1 - fresnel(thread.ior, co))
    else:
        f = fresnel(thread.ior, np.cos(theta_d) * cos_half)
        transmitted = (1 - f) ** 2
    kd = thread.isotropic
    surface = f * cos_half * gaussian(thread.gamma_surface, theta_h)
    lobe = (1 - kd) * gaussian(thread.gamma_volume, theta_h) + kd
    volume = transmitted * lobe / np.maximum(ci + co, 1e-3)
    compressed = np.maximum(np.cos(theta_d) ** 2, 1e-6)
    return surface / compressed, volume / compressed


def thread_value(thread: Thread, model: str, wi: Array, wo: Array) -> Array:
    """(n, 3) `f_s` [1/sr] without cosine, directions in the thread frame."""
    surface, volume = thread_terms(thread, model, angles(wi), angles(wo))
    return surface[..., None] + volume[..., None] * albedo_of(thread, model)


def albedo_of(thread: Thread, model: str) -> Array:
    """(3,) `A`, clamped to 1 where it is an albedo."""
    return np.minimum(thread.albedo, 1.0) if model == "conserving" else np.array(thread.albedo)


def masked(x: Array, y: Array, width: float) -> Array:
    """`M` of azimuths phi, `P` of azimuths psi [rad]: the share seen and lit. Section 4."""
    mx, my = np.maximum(np.cos(x), 0), np.maximum(np.cos(y), 0)
    u = np.exp(-(wrap(x - y) ** 2) / (2 * width**2))
    return (1 - u) * mx * my + u * np.minimum(mx, my)


def curve_points(curve: TangentCurve, per_segment: int = 64) -> tuple[Array, Array]:
    """(psi0, weight), each (k,): midpoints by length; weights sum to 1. Jumps weigh nothing."""
    p, a = np.array(curve.positions), np.array(curve.angles)
    middle = (np.arange(per_segment) + 0.5) / per_segment
    psi0 = [a[k] + (a[k + 1] - a[k]) * middle for k in range(len(p) - 1) if p[k + 1] > p[k]]
    weight = np.diff(p)[np.diff(p) > 0] / (p[-1] - p[0])
    return np.concatenate(psi0), np.repeat(weight / per_segment, per_segment)


@dataclass(frozen=True, kw_only=True)
class Share:
    """Part of the cloth: one type of thread in one set, and how much area it covers."""

    thread: Thread
    model: str
    is_warp: bool
    area: float


def shares(fabric: Fabric) -> tuple[Share, ...]:
    """Who covers how much of the cloth, for everyone that covers anything. Section 3."""
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
    """Share of the cloth that no thread covers."""
    return 1.0 - sum(share.area for share in shares(fabric))


def normalization(fabric: Fabric, wi: Array, wo: Array, per_segment: int = 64) -> Array:
    """`Q` : (n,) = sum of a <P> + gap (N.wo)."""
    q = gap(fabric) * np.asarray(wo)[..., 2]
    for share, psi0, area in _nodes(fabric, per_segment):
        i = angles(to_thread(wi, share.is_warp, psi0))
        o = angles(to_thread(wo, share.is_warp, psi0))
        q = q + area * masked(i.psi, o.psi, fabric.masking_width)
    return q


def segment(
    fabric: Fabric,
    share: Share,
    psi0: float | Array,
    wi: Array,
    wo: Array,
    width: Array | None = None,
) -> Array:
    """(n, 3) `f_s M P cos theta_i` of a bit of thread at `psi0`, before the division by `Q`.

    width : (n,) or None - `w` in [-1, 1] across the thread (level `thread`), None for the mean
    """
    i = angles(to_thread(wi, share.is_warp, psi0))
    o = angles(to_thread(wo, share.is_warp, psi0))
    surface, volume = thread_terms(share.thread, share.model, i, o)
    if width is not None:
        across_surface, across_volume = across(share.thread, i, o, width)
        surface, volume = surface * across_surface, volume * across_volume
    value = surface[..., None] + volume[..., None] * albedo_of(share.thread, share.model)
    visible = masked(i.phi, o.phi, fabric.masking_width) * masked(
        i.psi, o.psi, fabric.masking_width
    )
    return np.asarray(value * (visible * np.cos(i.theta))[..., None])


def across(thread: Thread, i: Angles, o: Angles, w: Array) -> tuple[Array, Array]:
    """Factors (n,) on surface and volume term at `w` across the thread; each averages to 1."""
    half = o.phi + 0.5 * wrap(i.phi - o.phi)
    h = np.where(np.abs(half) > math.pi / 2, np.sign(half), np.sin(half))
    beta = max(thread.gamma_surface, 0.1)
    root = beta * math.sqrt(2)
    z = beta * math.sqrt(2 * math.pi) / 4 * (erf((1 - h) / root) + erf((1 + h) / root))
    return np.exp(-((w - h) ** 2) / (2 * beta**2)) / z, 1 + w * (np.sin(i.phi) + np.sin(o.phi)) / 2


def _published(value: Array, q: Array, wi: Array, wo: Array) -> Array:
    """`value / Q`, 0 at or below the cloth and where `Q` is nothing."""
    lit = (np.asarray(wi)[..., 2] > 0) & (np.asarray(wo)[..., 2] > 0) & (q > NOTHING)
    return np.where(lit[..., None], value / np.where(lit, q, 1.0)[..., None], 0.0)


def far(fabric: Fabric, wi: Array, wo: Array, per_segment: int = 64) -> Array:
    """(n, 3) level `far` of the published models: radiance per unit `L_i dwi`."""
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
    """(n, 3) level `weave` (`thread` with a `width`) on thread `share` at tangent angle `psi0`."""
    value = segment(fabric, share, psi0, wi, wo, width)
    return _published(value, normalization(fabric, wi, wo, per_segment), wi, wo)


def conserving_far(fabric: Fabric, wi: Array, wo: Array, per_segment: int = 64) -> Array:
    """(n, 3) single scattering of `conserving` cloth over the whole sphere, cosine included."""
    wi, wo = np.asarray(wi, np.float64), np.asarray(wo, np.float64)
    value = np.zeros((*wi.shape[:-1], 3))
    s_i, s_o = np.zeros(wi.shape[:-1]), np.zeros(wi.shape[:-1])
    for share, psi0, area in _nodes(fabric, per_segment):
        psi0 = float(np.clip(psi0, -PILE_ANGLE, PILE_ANGLE))
        ti, to = (to_thread(w, share.is_warp, psi0) for w in (wi, wo))
        mu_i = np.maximum(np.sign(wi[..., 2]) * ti[..., 2], 0)
        mu_o = np.maximum(np.sign(wo[..., 2]) * to[..., 2], 0)
        q = area / max(math.cos(psi0), math.cos(PILE_ANGLE))
        s_i, s_o = s_i + q * mu_i, s_o + q * mu_o
        f_s = thread_value(share.thread, "conserving", ti, to)
        value = value + (q * mu_i * mu_o)[..., None] * f_s
    covered = 1.0 - gap(fabric)
    up_i, up_o = np.abs(wi[..., 2]), np.abs(wo[..., 2])
    with np.errstate(divide="ignore", invalid="ignore"):
        g_i, g_o = np.minimum(1, covered * up_i / s_i), np.minimum(1, covered * up_o / s_o)
        scale = g_i * g_o / up_o
    scale = np.where((up_i > 0) & (up_o > 0) & (s_i > 0) & (s_o > 0), scale, 0.0)
    return np.asarray(value * scale[..., None])


def white(fabric: Fabric, albedo: float = 1.0) -> Fabric:
    """`fabric` with `A` of every thread set to `albedo` in all channels."""
    threads = {k: replace(t, albedo=(albedo,) * 3) for k, t in fabric.threads.items()}
    return replace(fabric, threads=threads)

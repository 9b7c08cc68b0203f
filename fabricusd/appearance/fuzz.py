"""Fuzz: fibres that stand off the threads, as a thin layer over cloth of any law, at any level.

Hairiness H is the length of the fibres that protrude from a yarn over the length of the yarn
[UsterStatistics]. Half of them stand on each face of the cloth. The layer's fibres point anywhere,
each scatters as its thread does, and light meets one of them at most before it leaves:

    tau   = pi/4 d sum over sets of (threads per length) H/2
    f     = cover P(wi.wo) mu_i/(mu_i + mu_o) (1 - exp(-tau (1/mu_i + 1/mu_o)))
    value = f + T(wi) T(wo) again (value of the cloth)

d is a fibre's diameter, mu the cosine to the normal. P(angle) is the mean of
f_s cos(theta_i) cos(theta_o) over all directions of a fibre, divided by pi/4, the mean of its
cosine; it integrates to the albedo of fibres. f is single scattering in a plane layer
[Chandrasekhar1960].
What a fibre scatters and the viewer's side does not receive reaches the cloth:

    T(w) = 1 - (1 - exp(-tau/mu)) (1 - albedo) - (white sky's integral of f)
    again = (rho a + tau b)/rho for reflection, (tau a + rho b)/tau for transmission,
    (a, b) = sum over n of (rho_fuzz [[rho, tau], [tau, rho]])^n (1, 0)

with rho and tau the diffuse reflectance and transmittance of the cloth: `again` is what goes to and
fro between cloth and fuzz, without which white fibres on white cloth would lose light. Fibres stand
over threads only: gaps stay as open as they are, and the mean over the repeat is exact. Light from
behind the cloth crosses the fuzz of both faces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.plain import albedo_of, thread_terms
from fabricusd.appearance.scattering.plain_lobes import angles
from fabricusd.appearance.weave.coverage import coverage, sets
from fabricusd.fabric import Fabric, Thread
from fabricusd.kernels.real import INLINE, KERNEL, atan2

Floats = NDArray[np.float64]

FIBRE = 15e-6
"""Diameter of a fibre [m]: cotton has 12 to 16 micrometres, fine wool 17 to 20, polyester 12."""

ON_A_FACE = 0.5
"""Share of a yarn's protruding fibres that stand on one face of the cloth."""

_ANGLES, _COSINES, _FIBRES = 33, 17, 1 << 11
"""Entries of P between 0 and 180 degrees, of the albedo between mu = 0 and 1, and directions of
fibres that P is the mean over: it is right to .3 % for the narrowest published lobe."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fibres:
    """What the fuzz of a fabric is made of, apart from the albedo of its threads.

    depth : float - tau, at normal incidence
    share : (k,) float - share of the cloth that each thread type covers; sums to 1 - gap
    surface, volume : (k, 33) float - P [1/sr] by thread and angle, as a sum
        surface + volume A
    """

    depth: float
    share: Floats
    surface: Floats
    volume: Floats


class Fuzz(NamedTuple):
    """Tables of the fuzz of one fabric, in one precision.

    depth : real - tau
    phase : (k + 1, 33, 3) real - P [1/sr] by thread, the last row the mean over the cloth, gaps
        included
    lost : (3,) real - 1 - albedo of fibres; up : (17, 3) real - share of the light that meets the
        fuzz and leaves on its side, by mu
    again : (2, 3) real - of reflection, of transmission
    """

    depth: Any
    phase: NDArray[Any]
    lost: NDArray[Any]
    up: NDArray[Any]
    again: NDArray[Any]


def optical_depth(fabric: Fabric) -> float:
    """tau: fibres in the way of light along the normal, as a mean number."""
    threads = fabric.thread_list
    length = sum(
        s.density * float(np.mean([threads[k].hairiness for k in s.sequence])) for s in sets(fabric)
    )
    return math.pi / 4 * FIBRE * ON_A_FACE * length


def bald(fabric: Fabric) -> Fabric:
    """`fabric` without fuzz."""
    threads = {name: replace(t, hairiness=0.0) for name, t in fabric.threads.items()}
    return replace(fabric, threads=threads)


def fibres_of(fabric: Fabric) -> Fibres | None:
    """The fibres that stand off the threads of `fabric`, or None where no thread has any."""
    depth = optical_depth(fabric)
    if depth == 0.0:
        return None
    parts = [_phase(_colorless(t), fabric.model_of(t)) for t in fabric.thread_list]
    surface, volume = (np.array(rows) for rows in zip(*parts, strict=True))
    share = coverage(fabric).type_area.sum(axis=0)
    return Fibres(depth=depth, share=share, surface=surface, volume=volume)


def compile_fuzz(fabric: Fabric, diffuse: Floats, precision: type[Any]) -> Fuzz | None:
    """Tables of the fuzz of `fabric`; None where no thread has any.

    diffuse : (2, 3) shares of diffuse light that the cloth beneath reflects and transmits, without
        what passes through gaps
    """
    fibres = fibres_of(fabric)
    if fibres is None:
        return None
    color = np.array([albedo_of(t, fabric.model_of(t)) for t in fabric.thread_list])
    phase = fibres.surface[..., None] + fibres.volume[..., None] * color[:, None]
    # Published threads may be brighter than white. Their fibres are not.
    phase /= np.maximum(1.0, albedo_weights() @ phase)[:, None]
    covered = fibres.share.sum()
    whole = np.tensordot(fibres.share, phase, axes=1)
    mean = whole / covered if covered > 0 else whole
    cosine = np.linspace(0.0, 1.0, _COSINES)
    scattered = gathered(fibres.depth) @ mean
    up = scattered / met(fibres.depth, cosine)[:, None]
    again = to_and_fro(diffuse / max(covered, 1e-9), cosine_mean(fibres.depth) @ mean)
    return Fuzz(
        precision(fibres.depth),
        *(
            np.ascontiguousarray(x, precision)
            for x in (
                np.concatenate((phase, whole[None])),
                1.0 - albedo_weights() @ mean,
                up,
                again,
            )
        ),
    )


def to_and_fro(diffuse: Floats, fuzz: Floats) -> Floats:
    """(2, ...) `again` of cloth with the shares `diffuse` (2, ...) under fuzz that reflects `fuzz`.

    Cloth that is brighter than white counts as white.
    """
    reflected, through = np.clip(diffuse, 0.0, 1.0)
    through = np.minimum(through, 1.0 - reflected)
    # The two faces alike, and against one another.
    same = 1.0 / (1.0 - fuzz * (reflected + through))
    against = 1.0 / (1.0 - fuzz * (reflected - through))
    a, b = 0.5 * (same + against), 0.5 * (same - against)
    ratio = np.divide(through, reflected, out=np.zeros_like(through), where=reflected > 0)
    other = np.divide(reflected, through, out=np.zeros_like(through), where=through > 0)
    return np.stack((a + ratio * b, a + other * b))


def met(depth: float, cosine: Floats) -> Floats:
    """Share of the light that meets a fibre, by mu."""
    return np.asarray(-np.expm1(-depth / np.maximum(cosine, 1e-9)))


def albedo_weights() -> Floats:
    """(33,) weights whose product with P is its integral over the sphere."""
    return 2 * math.pi * _hats(np.sin)


@lru_cache(maxsize=64)
def gathered(depth: float) -> Floats:
    """(17, 33): its product with P is the albedo of the fuzz, by mu."""
    return np.array([gathered_at(depth, mu) for mu in np.linspace(0.0, 1.0, _COSINES)])


@lru_cache(maxsize=64)
def cosine_mean(depth: float) -> Floats:
    """(33,): its product with P is the reflectance of the fuzz in diffuse light."""
    x, w = np.polynomial.legendre.leggauss(24)
    mu, weight = 0.5 * (x + 1.0), 0.5 * w
    rows = np.array([gathered_at(depth, float(m)) for m in mu])
    return np.asarray((2.0 * weight * mu) @ rows)


def gathered_at(depth: float, mu_o: float) -> Floats:
    """(33,): its product with P is what a viewer at mu_o receives under a white sky."""
    x, w = np.polynomial.legendre.leggauss(24)
    mu, weight = 0.5 * (x + 1.0), 0.5 * w
    phi = (np.arange(48) + 0.5) * (2 * math.pi / 48)
    mu_i, around = np.meshgrid(mu, phi, indexing="ij")
    # At the horizon the viewer sees the fuzz alone.
    seen = max(mu_o, 1e-9)
    passes = np.exp(-depth / mu_i) * math.exp(-depth / seen)
    value = mu_i / (mu_i + seen) * (1.0 - passes) * (weight[:, None] * 2 * math.pi / 48)
    cosine = mu_i * mu_o + np.sqrt(1 - mu_i**2) * math.sqrt(1 - mu_o**2) * np.cos(around)
    at = np.arccos(np.clip(cosine, -1.0, 1.0)) * ((_ANGLES - 1) / math.pi)
    k = np.minimum(at.astype(np.int64), _ANGLES - 2)
    out = np.zeros(_ANGLES)
    np.add.at(out, k, value * (k + 1 - at))
    np.add.at(out, k + 1, value * (at - k))
    return out


def _hats(function: Any) -> Floats:
    """(33,) integrals of `function` over 0 to pi times what linear interpolation gives each
    entry."""
    x, w = np.polynomial.legendre.leggauss(8)
    step = math.pi / (_ANGLES - 1)
    part = 0.5 * (x + 1.0)
    out = np.zeros(_ANGLES)
    for k in range(_ANGLES - 1):
        value = function((k + part) * step) * 0.5 * w * step
        out[k] += float(value @ (1.0 - part))
        out[k + 1] += float(value @ part)
    return out


def _colorless(thread: Thread) -> Thread:
    """The thread without what the phase function of its fibres does not depend on."""
    return Thread(
        ior=thread.ior, isotropic=thread.isotropic, gamma_surface=thread.gamma_surface,
        gamma_volume=thread.gamma_volume, surface_gain=thread.surface_gain,
    )  # fmt: skip


@lru_cache(maxsize=64)
def _phase(thread: Thread, model: str) -> tuple[Floats, Floats]:
    """P of the surface and of the white volume of a fibre that scatters as `thread`, each (33,)."""
    k = np.arange(_FIBRES)
    z = (k + 0.5) / _FIBRES
    # A fibre has no ends: half of the sphere is all of it.
    turn = k * (math.pi * (3.0 - math.sqrt(5.0)))
    flat = np.sqrt(1.0 - z * z)
    t = np.stack((flat * np.cos(turn), flat * np.sin(turn), z), axis=-1)
    aside = np.where(np.abs(t[:, :1]) > 0.7, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    b = np.cross(t, aside)
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    frame = np.stack((t, b, np.cross(b, t)), axis=1)
    out = np.zeros((2, _ANGLES))
    for n, angle in enumerate(np.linspace(0.0, math.pi, _ANGLES)):
        i, o = (
            angles(frame @ w)
            for w in (
                np.array([0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)]),
                np.array([0.0, -math.sin(0.5 * angle), math.cos(0.5 * angle)]),
            )
        )
        across = np.cos(i.theta) * np.cos(o.theta) / (math.pi / 4)
        for part, value in enumerate(thread_terms(thread, model, i, o)):
            out[part, n] = float((value * across).mean())
    return out[0], out[1]


@njit(**INLINE)
def fuzz_over(R, fuzz, row, ix, iy, iz, ox, oy, oz, r, g, b):  # type: ignore[no-untyped-def]
    """(r, g, b) of cloth beneath the fuzz, from that of the cloth: radiance per unit `L_i dwi`.

    row : of `Fuzz.phase`, or -1 in a gap, where there are no fibres
    """
    mu_i, mu_o = abs(iz), abs(oz)
    least = R(1e-6)
    met_i = R(1) - math.exp(-fuzz.depth / max(mu_i, least))
    met_o = R(1) - math.exp(-fuzz.depth / max(mu_o, least))
    last = fuzz.up.shape[0] - 1
    at_i, at_o = min(mu_i, R(1)) * R(last), min(mu_o, R(1)) * R(last)
    m, n = min(int(at_i), last - 1), min(int(at_o), last - 1)
    x, y = at_i - R(m), at_o - R(n)
    above = row >= 0 and iz * oz > R(0)
    a, k, e = R(0), 0, R(0)
    if above:
        # The half of the angle between the directions, by the lengths of their difference and sum.
        dx, dy, dz, sx, sy, sz = ix - ox, iy - oy, iz - oz, ix + ox, iy + oy, iz + oz
        half = atan2(
            R, math.sqrt(dx * dx + dy * dy + dz * dz), math.sqrt(sx * sx + sy * sy + sz * sz)
        )
        a = half * R(2 * (_ANGLES - 1) / math.pi)
        k = min(int(a), _ANGLES - 2)
        a -= R(k)
        e = mu_i / (mu_i + mu_o) * (R(1) - (R(1) - met_i) * (R(1) - met_o))
    way = 0 if iz * oz > R(0) else 1
    r = _channel(R, fuzz, 0, way, row, m, x, n, y, met_i, met_o, above, k, a, e, r)
    g = _channel(R, fuzz, 1, way, row, m, x, n, y, met_i, met_o, above, k, a, e, g)
    b = _channel(R, fuzz, 2, way, row, m, x, n, y, met_i, met_o, above, k, a, e, b)
    return r, g, b


@njit(**INLINE)
def _channel(R, fuzz, c, way, row, m, x, n, y, met_i, met_o, above, k, a, e, value):
    """One channel of `fuzz_over`; way : row of `Fuzz.again`; (m, x) and (n, y) : places of wi and
    wo in `Fuzz.up`; (k, a) : in `Fuzz.phase`; e : factor of P."""
    up_i = fuzz.up[m, c] + x * (fuzz.up[m + 1, c] - fuzz.up[m, c])
    up_o = fuzz.up[n, c] + y * (fuzz.up[n + 1, c] - fuzz.up[n, c])
    kept = (R(1) - met_i * (fuzz.lost[c] + up_i)) * (R(1) - met_o * (fuzz.lost[c] + up_o))
    value *= kept * fuzz.again[way, c]
    if above:
        p = fuzz.phase[row, k, c]
        value += e * (p + a * (fuzz.phase[row, k + 1, c] - p))
    return value


@njit(**KERNEL, parallel=True)
def fuzz_over_all(R, depth, phase, lost, up, again, rows, wi, wo, out):  # type: ignore[no-untyped-def]
    """`fuzz_over` of out (3, n); rows : (n,) or (1,) for all."""
    for k in prange(out.shape[1]):
        # numba's parallel loops cannot take a tuple of arrays, so the fuzz is passed in parts.
        fuzz = Fuzz(depth, phase, lost, up, again)
        row = rows[0] if rows.size == 1 else rows[k]
        out[0, k], out[1, k], out[2, k] = fuzz_over(
            R, fuzz, row, wi[0, k], wi[1, k], wi[2, k], wo[0, k], wo[1, k], wo[2, k],
            out[0, k], out[1, k], out[2, k],
        )  # fmt: skip

"""One layer of woven `conserving` cloth, from the shares of light that its law is fitted to.

The law's factors are fitted such that the shares of light by side are those that the fabric states
(`appearance.conserving.multiple`). Under a white sky the law is therefore a sum of those shares:

    R(w) = (1 - gap) (s sigma + A (1 - s) rho) + C(A) (1 - tau) m
    T(w) = gap + (1 - gap) (1 - s) theta (x + A (1 - x)) + C(A) tau m

s is the share of the light on the threads that their surfaces reflect; sigma, rho, theta and tau
are `Sides.surface`, `reflected`, `transmitted` and `forward`; x is the surface's share of what is
transmitted at once; m = 1 - gap - (1 - gap) (s sigma + (1 - s) (rho + theta)); and
C = alpha^2 p / (1 - alpha (1 - p)). By reciprocity R(w) is both the radiance towards w under a
white sky, and the light that is reflected of what arrives from w.

Plain NumPy: a fabric is authored and described without compiling kernels. `bench/colour` and the
tests hold the numbers to `surface.evaluate`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.conserving.by_side import by_side
from fabricusd.appearance.layer.fuzz import VIEW
from fabricusd.appearance.layer.layer import Layer, mean_surface, surface_albedo
from fabricusd.appearance.plain import Share, curve_points, shares, to_thread
from fabricusd.appearance.scattering.models.conserving import plain_surface
from fabricusd.appearance.scattering.plain_lobes import angles, longitudinal
from fabricusd.fabric import CONSERVING_MODEL, Fabric, Thread

Floats = NDArray[np.float64]

_POLAR, _AZIMUTHS, _PIECES = 12, 8, 4
"""Gauss-Legendre points between the normal and the horizon, azimuths over half a turn, and nodes
per linear piece of a curve."""


def woven_layer(fabric: Fabric) -> Layer:
    """One layer of `fabric`, of which threads of other models count as black, as in its law."""
    theta, weight = _views()
    phi = (np.arange(2 * _AZIMUTHS) + 0.5) * (math.pi / _AZIMUTHS)
    polar, azimuth = np.meshgrid(theta, phi, indexing="ij")
    w = np.stack(
        (np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)), axis=-1
    )
    stated = by_side(fabric, polar, azimuth)
    covered, count = 1.0 - stated.gap, len(fabric.threads)
    seen = [_seen(part, w) for part in shares(fabric)]
    total = sum(area for area, _ in seen)
    parts = shares(fabric)
    lit, inside = np.zeros(polar.shape), np.zeros((*polar.shape, count))
    for part, (area, reflected) in zip(parts, seen, strict=True):
        lit += area / total * reflected
        if part.model == CONSERVING_MODEL:
            k = fabric.thread_list.index(part.thread)
            inside[..., k] += area / total * (1.0 - reflected)
    own, other = covered * lit * stated.surface, covered * (1.0 - lit) * stated.transmitted
    if fabric.opaque:
        other = np.zeros_like(other)
    rest = np.maximum(
        covered * (1.0 - lit * stated.surface - (1.0 - lit) * stated.reflected) - other, 0.0
    )
    forward = np.zeros_like(rest) if fabric.opaque else stated.forward
    through = _surface_through(parts)
    sent = (
        own, other * through,
        *(covered * inside[..., k] * stated.reflected for k in range(count)),
        *((0.0 if fabric.opaque else 1.0) * covered * inside[..., k] * stated.transmitted
          * (1.0 - through) for k in range(count)),
        (1.0 - forward) * rest, forward * rest,
        np.zeros_like(rest) if fabric.opaque else stated.gap,
        rest, covered,
    )  # fmt: skip
    rows = np.array([_rows(values, weight) for values in sent]).T
    kept, mean, bright = rows[:, -2:], np.zeros(count), np.zeros(count)
    area_of_all = sum(part.area for part in parts)
    for part in parts:
        if part.model == CONSERVING_MODEL:
            k = fabric.thread_list.index(part.thread)
            mean[k] += part.area / area_of_all
            bright[k] = mean_surface(part.thread)
    return Layer(
        surface=rows[:, :2],
        volume=np.stack((rows[:, 2 : 2 + count], rows[:, 2 + count : 2 + 2 * count]), axis=1),
        rest=rows[:, 2 + 2 * count : 4 + 2 * count],
        gap=rows[:, 4 + 2 * count],
        escape=float(1.0 - kept[1, 0] / kept[1, 1]),
        mean=mean,
        bright=bright,
    )


def _views() -> tuple[Floats, Floats]:
    """Polar angles [rad], the view first, and the weight of each in diffuse light."""
    x, w = np.polynomial.legendre.leggauss(_POLAR)
    theta = math.pi / 4 * (x + 1.0)
    weight = math.pi / 4 * w * 2.0 * np.sin(theta) * np.cos(theta)
    return np.concatenate(([VIEW], theta)), np.concatenate(([0.0], weight))


def _rows(values: Floats, weight: Floats) -> tuple[float, float]:
    """(at the view, in diffuse light) of values by polar angle and azimuth."""
    around = values.mean(axis=1)
    return float(around[0]), float(around @ weight)


def _seen(part: Share, w: Floats) -> tuple[Floats, Floats]:
    """(area of the part's facets that w sees, share of light that their surfaces reflect)."""
    total, reflected = np.zeros(w.shape[:-1]), np.zeros(w.shape[:-1])
    for psi0, weight in zip(*curve_points(part.thread.curve, _PIECES * 2), strict=True):
        local = to_thread(w, part.is_warp, float(psi0))
        area = part.area * weight / math.cos(psi0) * np.maximum(local[..., 2], 0.0)
        total += area
        theta = np.arcsin(np.clip(local[..., 0], -1.0, 1.0))
        reflected += area * surface_albedo(part.thread, theta)
    return total, np.divide(reflected, total, out=np.zeros_like(total), where=total > 0)


def _surface_through(parts: tuple[Share, ...]) -> float:
    """The surface's share of what white threads transmit at once, of light from the view.

    It hardly depends on the direction of the light (0.077 from above, 0.08 in diffuse light), and
    on the weave not at all.
    """
    x, w = np.polynomial.legendre.leggauss(_POLAR)
    y = (np.arange(4 * _AZIMUTHS) + 0.5) * (math.pi / (2 * _AZIMUTHS))
    theta, phi = np.meshgrid(math.pi / 4 * (x + 1.0), y, indexing="ij")
    below = np.stack(
        (np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), -np.cos(theta)), axis=-1
    )
    above, sent, total = np.array([0.0, 0.0, 1.0]), np.zeros((2, *theta.shape)), np.zeros(())
    for part in parts:
        for psi0, weight in zip(*curve_points(part.thread.curve, _PIECES), strict=True):
            i, o = (to_thread(v, part.is_warp, float(psi0)) for v in (above, below))
            area = part.area * weight / math.cos(psi0) * np.maximum(-o[..., 2], 0.0)
            total = total + area
            terms = _terms(part.thread, np.broadcast_to(i, o.shape), o)
            sent += np.maximum(i[..., 2], 0.0) * area * np.stack(terms)
    # What leaves is masked as what arrives is: G1 of the law.
    covered = sum(part.area for part in parts)
    masked = np.minimum(1.0, covered * np.cos(theta) / np.maximum(total, 1e-300))
    surface, volume = (sent * masked * w[:, None] * np.sin(theta)).sum(axis=(1, 2))
    return float(surface / (surface + volume)) if surface + volume > 0 else 0.0


def _terms(thread: Thread, i: Floats, o: Floats) -> tuple[Floats, Floats]:
    """The surface term and the white volume term; what the latter lacks of 1 - E(theta_i) is
    spread as the rest of it is, instead of by the completing term."""
    at_i, at_o = angles(i), angles(o)
    x, w = np.polynomial.legendre.leggauss(48)
    theta = math.pi / 2 * x
    start = np.full(theta.shape, float(at_i.theta.flat[0]))
    found = _volume(thread, start, theta) * np.cos(theta) ** 2
    whole = 2 * math.pi * math.pi / 2 * float(w @ found)
    kept = 1.0 - surface_albedo(thread, start[:1])[0]
    return plain_surface(thread, at_i, at_o), _volume(thread, at_i.theta, at_o.theta) * kept / whole


def _volume(thread: Thread, theta_i: Floats, theta_o: Floats) -> Floats:
    """The volume term without its constants and its completion."""
    lobe = longitudinal(theta_i, theta_o, 2 * thread.gamma_volume)
    widest = np.maximum(np.maximum(np.cos(theta_i), np.cos(theta_o)), 1e-6)
    even = thread.isotropic / math.pi**2
    lobe = (1 - thread.isotropic) * lobe / (2 * math.pi * widest) + even
    return np.asarray((1.0 - surface_albedo(thread, theta_o)) * lobe)

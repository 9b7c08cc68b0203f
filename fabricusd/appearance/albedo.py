"""Compute a fabric's directional albedo, and how bright its threads may be without gaining energy.

The published models do not conserve energy: their `A` is not an albedo, and the cloth can reflect
more light than it receives. The directional albedo is linear in `A`, so a single quadrature of the
surface and volume terms with white threads covers every colour. The module uses plain NumPy, so
that checking a fabric compiles no kernels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from fabricusd.appearance.laws import law_of
from fabricusd.appearance.laws.masked import plain_masked
from fabricusd.appearance.plain import (
    Share,
    curve_points,
    gap,
    shares,
    thread_terms,
    to_thread,
)
from fabricusd.appearance.scattering.model import CONSERVING
from fabricusd.appearance.scattering.models import named
from fabricusd.appearance.scattering.plain_lobes import Angles, angles
from fabricusd.fabric import PILE_ANGLE, Fabric

Floats = NDArray[np.float64]

WORST_VIEWS = (0.0, 40.0, 70.0, 80.0, 85.0, 88.0, 89.5)
"""Polar angles [degrees] that `safe_albedo` tests. The worst view of each published fabric is at 70
degrees or beyond."""

FINEST = math.radians(1.0)
"""Spacing [rad] of the table of the mean of `P`, whose narrowest feature is 20 degrees wide."""


@dataclass(frozen=True)
class Effort:
    """The resolution of the integration.

    azimuths : number of views around the normal, over a full turn
    curve_step : difference of tangent angle between curve nodes, in widths of the surface lobe
    least_nodes, most_nodes : bounds on the number of nodes of a linear piece of the curve
    inclinations : Gauss-Legendre points in each of the intervals that follow the lobes
    around : Gauss-Legendre points on each side of the viewer's azimuth
    """

    azimuths: int
    curve_step: float
    least_nodes: int
    most_nodes: int
    inclinations: int
    around: int


QUICK = Effort(azimuths=8, curve_step=2.0, least_nodes=2, most_nodes=6, inclinations=4, around=6)
FINE = Effort(azimuths=16, curve_step=1.0, least_nodes=6, most_nodes=16, inclinations=6, around=10)


def directional_albedo(
    fabric: Fabric, theta: Floats | list[float], effort: Effort = FINE
) -> tuple[Floats, Floats]:
    """Radiance that a viewer receives under a white sky of radiance 1: (surface, volume) per group.

    theta : (n,) polar angles of the viewer [rad]

    Returns two (n, azimuths, groups) arrays; the volume term is that of white threads, `A = 1`. The
    groups are those of `groups`. Nothing shadows the light: laws with an absolute shadow reflect at
    most this. The value of the fabric is the sum over groups of
    surface + A volume. Only the published models are evaluated: threads of the conserving law count
    as black.
    """
    angles = np.asarray(theta, np.float64)
    around = np.arange(effort.azimuths) * (2 * math.pi / effort.azimuths)
    t, p = (x.ravel() for x in np.meshgrid(angles, around, indexing="ij"))
    views = np.stack((np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)), axis=-1)
    parts = [group for group, _ in groups(fabric)]
    surface, volume = np.zeros((2, len(views), len(parts)))
    for k, part in enumerate(parts):
        if named(part.model).law == CONSERVING:
            continue
        for psi0, weight in zip(*_nodes(part, effort), strict=True):
            s, v = _node(fabric, parts, part, psi0, views, effort)
            surface[:, k] += part.area * weight * s
            volume[:, k] += part.area * weight * v
    shape = (len(angles), effort.azimuths, len(parts))
    return surface.reshape(shape), volume.reshape(shape)


def groups(fabric: Fabric) -> list[tuple[Share, Floats]]:
    """Merge threads that differ in colour only into one share of the cloth: (share, mean `A` (3,)).

    With this, a jacquard of sixty colours costs no more than one of two.
    """
    found: dict[tuple[object, ...], list[Share]] = {}
    for share in shares(fabric):
        plain = replace(
            share.thread, albedo=(1, 1, 1), color=(1, 1, 1), thickness=0.0, documentation=""
        )
        found.setdefault((plain, share.model, share.is_warp), []).append(share)
    merged = []
    for same in found.values():
        area = sum(share.area for share in same)
        color = sum(share.area / area * np.array(share.thread.albedo) for share in same)
        merged.append((replace(same[0], area=area), np.asarray(color, np.float64)))
    return merged


def albedo_by_view(fabric: Fabric, theta: Floats | list[float], effort: Effort = FINE) -> Floats:
    """(n, azimuths, 3) fraction of a white sky's radiance that reaches viewers at `theta` [rad]."""
    surface, volume = directional_albedo(fabric, theta, effort)
    colors = np.array([color for _, color in groups(fabric)])
    return np.asarray(surface.sum(axis=2)[..., None] + volume @ colors)


def safe_albedo(fabric: Fabric, effort: Effort = FINE) -> float:
    """The largest `A` at which white threads reflect no more than they receive, in the worst view.

    The result is 0 if the surface terms alone are too bright, and infinite if no thread has a
    volume term.
    """
    surface, volume = directional_albedo(fabric, np.radians(WORST_VIEWS), effort)
    left, white = 1.0 - surface.sum(axis=2), volume.sum(axis=2)
    return float(max(0.0, (left[white > 0] / white[white > 0]).min(initial=math.inf)))


def _nodes(part: Share, effort: Effort) -> tuple[Floats, Floats]:
    """(psi0, weight) along the curve, spaced by the width of the surface lobe."""
    curve = part.thread.curve
    steepest = max(abs(np.diff(curve.angles)), default=0.0)
    step = effort.curve_step * part.thread.gamma_surface
    count = int(min(max(math.ceil(steepest / step), effort.least_nodes), effort.most_nodes))
    return curve_points(curve, count)


def _mean_p(part: Share, width: float, i: Floats, o: Floats, effort: Effort) -> Floats:
    """`P` of the longitudes i and o [rad] in the untilted frame, averaged over the curve.

    Tilting the thread shifts both angles by the same amount, so two numbers describe both
    directions. The mean is read from a table, except on pile: there `Q` nearly vanishes, and it has
    to vanish exactly where its terms do.
    """
    if part.thread.curve.steepest > PILE_ANGLE:
        mean = np.zeros(np.broadcast_shapes(i.shape, o.shape))
        for psi0, weight in zip(*_nodes(part, effort), strict=True):
            mean += weight * plain_masked(i - psi0, o - psi0, width)
        return mean
    places = (np.stack(np.broadcast_arrays(i, o)) + math.pi / 2) / FINEST
    table = _p_table(part, width, effort)
    return np.asarray(map_coordinates(table, places, order=1, mode="nearest"))


@lru_cache(maxsize=32)
def _p_table(part: Share, width: float, effort: Effort) -> Floats:
    """The mean of `P` on a grid with the spacing `FINEST` in both longitudes."""
    psi = np.arange(-math.pi / 2, math.pi / 2 + FINEST / 2, FINEST)
    i, o = np.meshgrid(psi, psi, indexing="ij")
    table = np.zeros_like(i)
    for psi0, weight in zip(*_nodes(part, effort), strict=True):
        table += weight * plain_masked(i - psi0, o - psi0, width)
    return table


def _tilt(w: Floats, is_warp: bool) -> Floats:
    """psi [rad] of directions in the surface frame, for an untilted thread."""
    return np.asarray(np.arctan2(w[..., 1] if is_warp else w[..., 0], w[..., 2]))


def _node(
    fabric: Fabric,
    parts: list[Share],
    part: Share,
    psi0: float,
    views: Floats,
    effort: Effort,
) -> tuple[Floats, Floats]:
    """(views,) integrals over the sky of the surface and the volume term of thread at `psi0`."""
    c, s = math.cos(psi0), math.sin(psi0)
    along = views[:, 1] if part.is_warp else views[:, 0]
    across = -views[:, 0] if part.is_warp else views[:, 1]
    x, z = c * along - s * views[:, 2], s * along + c * views[:, 2]
    theta_o, phi_o = np.arcsin(np.clip(x, -1, 1)), np.arctan2(across, z)
    psi_o = np.arctan2(x, z)
    theta, theta_weight = _inclinations(theta_o, part, effort)
    phi, phi_weight = _around(phi_o, effort)
    # Axes: view, inclination, azimuth.
    t, p = theta[:, :, None], phi[:, None, :]
    ix, iy, iz = np.broadcast_arrays(np.sin(t), np.cos(t) * np.sin(p), np.cos(t) * np.cos(p))
    up = -s * ix + c * iz
    flat = c * ix + s * iz
    i = Angles(theta=t, phi=p, psi=np.arctan2(ix, iz))
    o = Angles(theta=theta_o[:, None, None], phi=phi_o[:, None, None], psi=psi_o[:, None, None])
    surface, volume = thread_terms(part.thread, part.model, i, o)
    law = law_of(fabric)
    seen = law.plain_weight(fabric, part.is_warp, psi0, i, o) * law.plain_mask(fabric, i, o)
    if law.absolute:
        q = _total(fabric, parts, views, effort)[:, None, None] + np.zeros(up.shape)
    else:
        w = np.stack((-iy, flat, up) if part.is_warp else (flat, iy, up), axis=-1)
        q = gap(fabric) * views[:, None, None, 2] + np.zeros(up.shape)
        for other in parts:
            to, width = _tilt(views, other.is_warp)[:, None, None], fabric.masking_width
            q += other.area * _mean_p(other, width, _tilt(w, other.is_warp), to, effort)
    lit = (up > 0) & (views[:, None, None, 2] > 0) & (q > 1e-12)
    # f cos(theta) times the solid angle cos(theta) dtheta dphi.
    measure = np.cos(t) ** 2 * theta_weight[:, :, None] * phi_weight[:, None, :]
    share = np.where(lit, seen * measure / np.where(lit, q, 1.0), 0.0)
    return (surface * share).sum(axis=(1, 2)), (volume * share).sum(axis=(1, 2))


def _total(fabric: Fabric, parts: list[Share], views: Floats, effort: Effort) -> Floats:
    """(views,) total of a law whose weight asks for the viewer alone."""
    law, seen = law_of(fabric), np.zeros(len(views))
    for part in parts:
        for psi0, weight in zip(*_nodes(part, effort), strict=True):
            o = angles(to_thread(views, part.is_warp, psi0))
            seen += part.area * weight * law.plain_weight(fabric, part.is_warp, psi0, o, o)
    return np.asarray(law.plain_total(fabric, seen, gap(fabric), views))


def _inclinations(theta_o: Floats, part: Share, effort: Effort) -> tuple[Floats, Floats]:
    """(views, n) inclinations and weights, in intervals that follow both lobes about -theta_o."""
    widths = np.array([2 * part.thread.gamma_surface, 2 * part.thread.gamma_volume])
    offsets = np.sort(np.concatenate([k * widths for k in (-4, -1.5, 0, 1.5, 4)]))
    edges = np.clip(-theta_o[:, None] + offsets, -math.pi / 2, math.pi / 2)
    ends = np.full((len(theta_o), 1), math.pi / 2)
    return _gauss(np.concatenate((-ends, edges, ends), axis=1), effort.inclinations)


def _around(phi_o: Floats, effort: Effort) -> tuple[Floats, Floats]:
    """(views, n) azimuths and weights on the thread's lit half, split at the kink of `M`."""
    half = math.pi / 2
    middle = np.clip(phi_o, -half, half)[:, None]
    ends = np.full((len(phi_o), 1), half)
    return _gauss(np.concatenate((-ends, middle, ends), axis=1), effort.around)


def _gauss(edges: Floats, count: int) -> tuple[Floats, Floats]:
    """Gauss-Legendre nodes and weights in every interval between (views, k) edges."""
    x, weight = np.polynomial.legendre.leggauss(count)
    middle, half = (edges[:, 1:] + edges[:, :-1]) / 2, (edges[:, 1:] - edges[:, :-1]) / 2
    nodes = middle[..., None] + half[..., None] * x
    weights = half[..., None] * weight
    return nodes.reshape(len(edges), -1), weights.reshape(len(edges), -1)

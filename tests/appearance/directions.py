"""Directions for the surface's tests: random, special, and quadrature over the sphere."""

from __future__ import annotations

import math

import numpy as np


def direction(theta, phi):
    """Unit vector at the polar angle theta from N and the azimuth phi from U, both in degrees."""
    t, p = math.radians(theta), math.radians(phi)
    return np.array([math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)])


def random_directions(n, seed, *, upper=True):
    """(n, 3) uniform over the upper hemisphere, or over the sphere."""
    w = np.random.default_rng(seed).normal(size=(n, 3))
    w /= np.linalg.norm(w, axis=1)[:, None]
    if upper:
        w[:, 2] = np.abs(w[:, 2])
    return w


VIEWS = {
    "normal": direction(2, 20),
    "along the weft": direction(35, 0),
    "along the warp": direction(40, 90),
    "slanting": direction(65, 215),
    "grazing": direction(83, 130),
}
"""Viewers above the cloth that no symmetry of the published fabrics singles out together."""


def sphere_cells(rows=6, columns=16, nodes=20, *, lower=False):
    """Quadrature over cells of a (N.w, azimuth) grid: directions (c, q, 3) and weights (c, q).

    The nodes crowd at the horizon and at the azimuths of U and V, where densities of lobes that the
    horizon cuts have integrable poles. With `lower` the cells below the cloth follow.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    t_edges = np.linspace(0, 1, rows + 1)
    p_edges = np.linspace(0, 2 * math.pi, columns + 1)
    half_t, half_p = np.diff(t_edges) / 2, np.diff(p_edges) / 2
    t = t_edges[:-1, None] + half_t[:, None] * (x + 1)
    # N.w = t^2, so d(N.w) = 2 t dt
    weight_t = half_t[:, None] * w * 2 * t
    phi = p_edges[:-1, None] + half_p[:, None] * (x + 1)
    weight_p = half_p[:, None] * w
    z = (t**2)[:, None, :, None]
    angle = phi[None, :, None, :]
    flat = np.sqrt(1 - z * z)
    z, angle, flat = np.broadcast_arrays(z, angle, flat)
    wi = np.stack((flat * np.cos(angle), flat * np.sin(angle), z), axis=-1)
    weights = np.einsum("ai,bj->abij", weight_t, weight_p)
    wi = wi.reshape(rows * columns, nodes * nodes, 3)
    weights = weights.reshape(rows * columns, nodes * nodes)
    if lower:
        wi = np.concatenate((wi, wi * (1, 1, -1)))
        weights = np.concatenate((weights, weights))
    return wi, weights


def cell_of(wi, rows=6, columns=16):
    """(n,) which of `sphere_cells` each direction lies in."""
    t = np.sqrt(np.abs(wi[:, 2]))
    row = np.clip((t * rows).astype(int), 0, rows - 1)
    phi = np.mod(np.arctan2(wi[:, 1], wi[:, 0]), 2 * math.pi)
    column = np.clip((phi / (2 * math.pi) * columns).astype(int), 0, columns - 1)
    return row * columns + column + np.where(wi[:, 2] < 0, rows * columns, 0)

"""The chi-squared test of a sampler on the sphere against the density it claims."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats


def sphere_cells(theta_edges, phi_edges, nodes=12):
    """Quadrature of every cell of a (theta, phi) grid, theta the inclination from the yz plane.

    Returns directions (a, b, nodes, nodes, 3) and weights (a, b, nodes, nodes) with the cosine in.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    half_t, half_p = np.diff(theta_edges) / 2, np.diff(phi_edges) / 2
    theta = theta_edges[:-1, None] + half_t[:, None] * (x + 1)
    phi = phi_edges[:-1, None] + half_p[:, None] * (x + 1)
    weight_t = half_t[:, None] * w * np.cos(theta)
    weights = np.einsum("ai,bj->abij", weight_t, half_p[:, None] * w)
    t, p = np.broadcast_arrays(theta[:, None, :, None], phi[None, :, None, :])
    return np.stack((np.sin(t), np.cos(t) * np.sin(p), np.cos(t) * np.cos(p)), axis=-1), weights


def p_value(samples, density, theta_edges, phi_edges, least=10.0):
    """Probability of so bad an agreement, or a worse one, if `samples` follow `density`.

    samples : (n, 3) unit vectors; density : (m, 3) -> (m,) [1/sr]
    Cells expecting fewer than `least` samples are pooled into one.
    """
    wi, weights = sphere_cells(theta_edges, phi_edges)
    expected = (density(wi.reshape(-1, 3)).reshape(weights.shape) * weights).sum(axis=(2, 3))
    expected = expected.ravel() * len(samples)
    theta = np.arcsin(np.clip(samples[:, 0], -1, 1))
    phi = np.arctan2(samples[:, 1], samples[:, 2])
    row = np.clip(np.searchsorted(theta_edges, theta, "right") - 1, 0, len(theta_edges) - 2)
    column = np.clip(np.searchsorted(phi_edges, phi, "right") - 1, 0, len(phi_edges) - 2)
    cell = row * (len(phi_edges) - 1) + column
    observed = np.bincount(cell, minlength=expected.size).astype(float)
    small = expected < least
    expected = np.append(expected[~small], expected[small].sum())
    observed = np.append(observed[~small], observed[small].sum())
    if expected[-1] < least:
        # A pool that small says nothing by itself; it joins the largest cell.
        largest = int(np.argmax(expected[:-1]))
        expected[largest] += expected[-1]
        observed[largest] += observed[-1]
        expected, observed = expected[:-1], observed[:-1]
    statistic = float(((observed - expected) ** 2 / expected).sum())
    return float(stats.chi2.sf(statistic, len(expected) - 1))


def threshold(level: float, tests: int) -> float:
    """p-value below which one of `tests` fails, so that a right table fails at rate `level`."""
    return 1.0 - math.pow(1.0 - level, 1.0 / tests)

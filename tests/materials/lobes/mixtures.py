"""Mixtures to test with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fabricusd.materials.lobes.mixture import MATERIALX, POWERS, Lobe, Mixture

PAIR = Lobe(
    along=0, tilt=0.6, paired=True, alpha_along=0.2, alpha_across=0.9, color=(0.3, 0.6, 0.2),
    facing=1.2, crossing=-0.8, upright=-0.5,
)  # fmt: skip
LEVEL = Lobe(
    along=1, tilt=0.0, paired=False, alpha_along=0.15, alpha_across=0.8, color=(0.9, 0.1, 1.4),
    facing=0.4, crossing=0.8, upright=0.5,
)  # fmt: skip
GAUSSIAN = replace(PAIR, alpha_along=0.35, alpha_across=0.7, gaussian=True)
"""A pair with Beckmann's distribution, which Cycles alone has."""


VIEW = tuple(round(0.1 * (-1.0) ** k / (1.0 + k % POWERS), 6) for k in range(5 * POWERS))
"""Coefficients of a V between 0.9 and 1.5."""


def mixture(form: str, *lobes: Lobe) -> Mixture:
    """Lobes and all else; those of MaterialX rise towards grazing light."""
    lobes = lobes or (PAIR, LEVEL)
    if form == MATERIALX:
        lobes = tuple(replace(one, rise=2.5 + k, rise_power=1.7) for k, one in enumerate(lobes))
    return Mixture(
        form=form, lobes=lobes, diffuse=(0.05, 0.1, 0.2), diffuse_power=0.4,
        sheen=(0.1, 0.2, 0.3), sheen_roughness=0.5, sheen_power=0.7, view=VIEW,
    )  # fmt: skip


def bare(form: str, lobe: Lobe) -> Mixture:
    """One lobe and nothing else."""
    return Mixture(
        form=form, lobes=(lobe,), diffuse=(0.0, 0.0, 0.0), diffuse_power=0.0,
        sheen=(0.0, 0.0, 0.0), sheen_roughness=0.5, sheen_power=0.0,
    )  # fmt: skip


def directions(count: int, seed: int = 0) -> np.ndarray:
    """(2, count, 3) unit vectors above the cloth."""
    w = np.random.default_rng(seed).normal(size=(2, count, 3))
    w[..., 2] = np.abs(w[..., 2]) + 0.02
    return w / np.linalg.norm(w, axis=-1, keepdims=True)

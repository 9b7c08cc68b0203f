"""A mixture of lobes at a texel, from the threads that the texel shows.

The lobes are those of the far mixture. With the shares w_b of the parts of the threads in a texel,

    color    = sum_b factor_kb w_b tint_b c_k
    m_kb     = luminance of factor_kb c_k, times w_b
    tilt     = psi_k + g (mu + (psi_k - mu_far) rho - psi_k)
    alpha^2  = alpha_k^2 + g (own_k^2 + (alpha_k^2 - own_k^2) rho^2 - alpha_k^2)
    rho^2    = (V + EPSILON)/(V_far + EPSILON)

mu and V are the mean and the variance of the tangent angle over the threads that run along the
lobe's own axis, weighted by m_kb, and g is the share that these have in the sum of m_kb. A lobe
thus turns with its own threads: where a texel shows one point of a thread, every lobe of the thread
is at its angle and as narrow as the thread makes it. Lobes that threads across the axis make, on
their flanks, stay where they are. The factors have the mean 1 over the cloth, so the texel that
shows the whole cloth is the far mixture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.materials.fit.models import sheen_value
from fabricusd.materials.lobes.colors import REC_709
from fabricusd.materials.lobes.mixture import (
    EVEN,
    UPRIGHT,
    Lobe,
    Mixture,
    reflected,
    view_factor,
    weight,
)
from fabricusd.materials.near.parts import COUNT, SETS, Parts, Texels

Floats = NDArray[np.float64]

EPSILON = 1e-3
"""Variance of the angle [rad^2] that is as good as none: a fifth of that of the narrowest lobes."""

STEEPEST = 1.5
"""Largest tilt [rad], as in a fit."""

THIN = 1e-6
"""Share of a texel that is as good as none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NearMixture:
    """A mixture and the threads that make its lobes.

    far : the mixture of the whole cloth
    factors : (lobes + 2, 8, 3) colour of each lobe, of the diffuse part and of the sheen on each
        part of the threads, over that of the far mixture; their mean over the parts is 1
    own : (lobes,) width along the thread that a lobe has at one point of a thread
    through : (8, 3) share of the light from behind that each part scatters through
    tinted : (2,) share of what a set reflects that has the colour of its threads

    Lobes are counted as `placed` orders them: both of a pair, one after the other.
    """

    far: Mixture
    parts: Parts
    factors: Floats
    own: Floats
    through: Floats
    tinted: Floats

    @property
    def lobes(self) -> list[tuple[Lobe, float]]:
        """Each lobe and its tilt."""
        return [(one, tilt) for one in self.far.lobes for tilt in one.tilts]


class Constants(NamedTuple):
    """What does not change from texel to texel, for one lobe.

    membership : (8,) luminance of the lobe on each part; own : (8,) the same, 0 for parts that run
        across the lobe's axis
    mean, variance : of the angle over the whole cloth [rad, rad^2]
    """

    membership: Floats
    own: Floats
    mean: float
    variance: float


class Placed(NamedTuple):
    """One lobe at n texels.

    color : (n, 3); tilt : (n,) [rad]; alpha : (n,) width along the thread
    """

    color: Floats
    tilt: Floats
    alpha: Floats


def constants(near: NearMixture, number: int) -> Constants:
    """Return the constants of a lobe."""
    lobe, _ = near.lobes[number]
    membership = near.factors[number] * np.array(lobe.color) @ REC_709
    own = np.where(SETS == lobe.along, membership, 0.0)
    _, mean, variance = _own_angle(near.parts, own, membership, near.parts.texel)
    return Constants(membership, own, float(mean[0]), float(variance[0]))


def placed(near: NearMixture, number: int, texels: Texels) -> Placed:
    """Return a lobe at texels."""
    lobe, far_tilt = near.lobes[number]
    known = constants(near, number)
    share, mean, variance = _own_angle(near.parts, known.own, known.membership, texels)
    square = (variance + EPSILON) / (known.variance + EPSILON)
    turned = mean + (far_tilt - known.mean) * np.sqrt(square)
    tilt = far_tilt + share * (turned - far_tilt)
    wide, narrow = lobe.alpha_along**2, near.own[number] ** 2
    alpha = wide + share * (narrow + (wide - narrow) * square - wide)
    return Placed(
        part_color(near, number, texels) * np.array(lobe.color),
        np.clip(tilt, -STEEPEST, STEEPEST),
        np.sqrt(np.clip(alpha, min(narrow, wide), 1.0)),
    )


def part_color(near: NearMixture, number: int, texels: Texels) -> Floats:
    """(n, 3) factor on the colour of a lobe, of the diffuse part or of the sheen."""
    tint = texels.tint / np.maximum(texels.sets, THIN)[..., None]
    tint = 1.0 + near.tinted[:, None] * (tint - 1.0)
    of_sets = np.einsum(
        "nsb,sbc->nsc",
        texels.share.reshape(-1, 2, COUNT // 2), near.factors[number].reshape(2, COUNT // 2, 3),
    )  # fmt: skip
    return np.asarray((of_sets * tint).sum(axis=1))


def _own_angle(
    parts: Parts, own: Floats, membership: Floats, texels: Texels
) -> tuple[Floats, Floats, Floats]:
    """(n,) share of a lobe's own threads in it, and the mean and variance of their angle."""
    sets = np.maximum(texels.sets, THIN)
    lean = texels.lean / sets
    within = np.maximum(texels.spread / sets - lean**2, 0.0)
    angle = parts.angle + lean[:, SETS]
    weights = texels.share * own
    total = np.maximum(weights.sum(axis=1), 1e-12)
    mean = (weights * angle).sum(axis=1) / total
    square = (weights * (angle**2 + within[:, SETS])).sum(axis=1) / total
    every = np.maximum((texels.share * membership).sum(axis=1), 1e-12)
    return weights.sum(axis=1) / every, mean, np.maximum(square - mean**2, 0.0)


def evaluate(near: NearMixture, texels: Texels, wi: Floats, wo: Floats) -> Floats:
    """(n, 3) radiance per unit `L_i dwi` at n texels, or at one for all, for unit wi, wo (n, 3).

    It is that of the whole texel, its gaps included, see `lobes.mixture.evaluate`.
    """
    far, count = near.far, len(near.lobes)
    seen = view_factor(far, wo)
    even = seen * np.maximum(wo[:, 2], EVEN) ** far.diffuse_power * wi[:, 2] / np.pi
    out = even[:, None] * np.array(far.diffuse) * part_color(near, count, texels)
    fuzz = seen * np.maximum(wo[:, 2], UPRIGHT) ** far.sheen_power
    fuzz = fuzz * sheen_value(far.sheen_roughness, wi, wo)
    out = out + fuzz[:, None] * np.array(far.sheen) * part_color(near, count + 1, texels)
    for number, (lobe, _) in enumerate(near.lobes):
        mine = placed(near, number, texels)
        alphas: Any = mine.alpha, lobe.alpha_across
        tilt: Any = mine.tilt
        one = reflected(far.form, lobe, tilt, alphas, wi, wo)
        f = (seen * weight(lobe, one, wo))[:, None] * mine.color
        out = out + one.value[:, None] * f * (1.0 + f * one.spared[:, None])
    above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
    return np.where(above[:, None], out, 0.0)

"""Parts, texels and mixtures near by to test with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from materials.lobes.mixtures import LEVEL, PAIR, mixture

from fabricusd.materials.lobes.mixture import MATERIALX, Mixture
from fabricusd.materials.near.mixture import NearMixture
from fabricusd.materials.near.parts import COUNT, Parts, Texels

PARTS = Parts(
    share=np.array((0.15, 0.1, 0.12, 0.08, 0.2, 0.0, 0.25, 0.0)),
    angle=np.array((0.1, 0.4, -0.12, -0.45, 0.05, 0.0, -0.06, 0.0)),
    spread=np.array((0.002, 0.0008)),
)
"""A cloth with a tenth of gaps, whose warp has no steep parts."""


def near_mixture(far: Mixture | None = None, seed: int = 1) -> NearMixture:
    """A mixture whose lobes are made by arbitrary threads."""
    far = far or mixture("cycles", PAIR, LEVEL)
    rng = np.random.default_rng(seed)
    count = far.count
    # Cycles packs normals: narrower lobes would show it by percents.
    own = np.full(count, 0.15)
    factors = rng.uniform(0.0, 2.0, (count + 2, COUNT, 3)) * (PARTS.share > 0)[:, None]
    factors /= np.einsum("kbc,b->kc", factors, PARTS.share)[:, None]
    return NearMixture(
        far=far, parts=PARTS, factors=factors, own=own,
        through=np.zeros((COUNT, 3)), tinted=np.array((0.6, 0.3)),
    )  # fmt: skip


def point(part: int, off: float = 0.03) -> Texels:
    """One point of a thread, whose angle is `off` that of its part."""
    angle = np.array((PARTS.angle[part] + off,))
    return PARTS.at(np.array((part // 4,)), angle, np.array((part,)))


def mixed(seed: int = 2, gap: float = 0.2) -> Texels:
    """One texel that shows all parts, and a share of gap, with a tint."""
    rng = np.random.default_rng(seed)
    share = rng.uniform(0.2, 1.0, (1, COUNT)) * (PARTS.share > 0)
    share *= (1.0 - gap) / share.sum()
    sets = share.reshape(1, 2, 4).sum(axis=2)
    lean = sets * rng.uniform(-0.05, 0.05, (1, 2))
    tint = sets[..., None] * rng.uniform(0.7, 1.3, (1, 2, 3))
    return Texels(share=share, lean=lean, spread=sets * 0.006, tint=tint)


def far_of_two() -> Mixture:
    """A mixture of a pair and a level lobe."""
    return mixture(MATERIALX, PAIR, replace(LEVEL, tilt=0.4))


TEXELS = {"weft": point(1), "warp": point(6), "mixed": mixed()}

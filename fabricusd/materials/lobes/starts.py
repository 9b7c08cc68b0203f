"""Where a fit starts: lobes at the plateaus of the fabric's tangent curves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.quadrature import curve_nodes, default_rule
from fabricusd.fabric import Fabric
from fabricusd.materials.lobes.mixture import Lobe, Mixture

Floats = NDArray[np.float64]

STEEPEST = 1.3
"""Largest tilt of a start [rad]: a lobe beyond is hardly seen."""

LEVEL = 0.05
"""Tilt below which a group of nodes is taken for level [rad]."""

FLANKS = ((), (0,), (1,), (0, 1))
"""Axes towards which there are flanks besides."""

LEAST = 0.02
"""Share of the cloth below which threads get no lobe of their own."""

Shape = tuple[float, bool]
"""Tilt of a lobe [rad], and whether it is one of a pair."""


def starts(fabric: Fabric, count: int, form: str) -> list[Mixture]:
    """Return mixtures of `count` lobes to start from."""
    nodes = curve_nodes(fabric, default_rule(fabric))
    of_set = (np.arange(len(nodes.psi0)) >= nodes.warp_start).astype(int)
    choices = []
    for along in (0, 1):
        mine = of_set == along
        if nodes.weight[mine].sum() >= LEAST:
            threads = [fabric.thread_list[k] for k in np.unique(nodes.thread[mine])]
            width = float(np.mean([t.gamma_surface for t in threads]))
            shapes = list(_shapes(nodes.psi0[mine], nodes.weight[mine], count))
            choices.append([(along, width, s) for s in (*shapes, ())])
    found: dict[Mixture, None] = {}
    for chosen, flanks in product(product(*choices), FLANKS):
        lobes = tuple(
            _lobe(along, width, tilt, paired, wide)
            for along, width, shapes in chosen
            for wide, (tilt, paired) in enumerate(shapes)
        )
        lobes += tuple(flank(along) for along in flanks if lobes)
        mixture = Mixture(
            form=form, lobes=lobes, diffuse=(0.05, 0.05, 0.05), diffuse_power=0.0,
            sheen=(0.01, 0.01, 0.01), sheen_roughness=0.4, sheen_power=0.0,
        )  # fmt: skip
        if mixture.count == count:
            found[mixture] = None
    return list(found)


def _shapes(psi: Floats, share: Floats, most: int) -> Iterator[tuple[Shape, ...]]:
    """Ways to place up to `most` lobes on threads of tangent angles psi."""
    if _symmetric(psi, share):
        size = np.abs(psi)
        top = min(float(size.max()), STEEPEST)
        level: Shape = (0.0, False)
        yield (level,)
        yield (level, level)
        if top < LEVEL:
            # A pair that is nearly level can take the shape of what no single lobe has.
            yield ((0.2, True),)
            yield (level, (0.2, True))
            return
        mean = float(np.average(size, weights=share))
        one, low, high = (top, True), (0.5 * mean, True), (max(mean, 0.6 * top), True)
        yield from ((one,), (one, level), (one, low), (one, high, level), (one, high, low))
        yield (one, level, level)
        return
    for groups in range(1, most + 1):
        edges = np.quantile(
            psi, (np.arange(groups) + 0.5) / groups, weights=share, method="inverted_cdf"
        )
        yield tuple((float(np.clip(t, -STEEPEST, STEEPEST)), False) for t in edges)


def _symmetric(psi: Floats, share: Floats) -> bool:
    """Whether the threads lean forwards as much as backwards."""
    order, back = np.argsort(psi), np.argsort(-psi)
    alike = np.allclose(psi[order], -psi[back], atol=1e-3)
    return bool(alike and np.allclose(share[order], share[back], atol=1e-3))


def _lobe(along: int, width: float, tilt: float, paired: bool, wide: int) -> Lobe:
    """A lobe as wide as the threads' own; each further one on the same threads is wider."""
    return Lobe(
        along=along, tilt=tilt, paired=paired,
        alpha_along=min(max(1.6 * width, 0.05) * 2.0**wide, 0.9), alpha_across=0.9,
        color=(0.1, 0.1, 0.1), facing=0.5, crossing=0.0, upright=0.0,
    )  # fmt: skip


def flank(along: int) -> Lobe:
    """A pair on the flanks of the threads that `along` crosses: light from low beside them."""
    return Lobe(
        along=along, tilt=0.9, paired=True, alpha_along=0.4, alpha_across=0.4,
        color=(0.05, 0.05, 0.05), facing=0.3, crossing=0.0, upright=0.0,
    )  # fmt: skip


def turned(mixture: Mixture, numbers: Iterable[int]) -> Mixture:
    """The mixture with the other distribution in the lobes of these numbers."""
    chosen = set(numbers)
    lobes = [
        replace(one, gaussian=one.gaussian != (k in chosen)) for k, one in enumerate(mixture.lobes)
    ]
    return replace(mixture, lobes=tuple(lobes))


FAINT = 0.01
"""Colour of a lobe that is added to a mixture."""


def grown(mixture: Mixture) -> list[Mixture]:
    """Mixtures with one more pair, faint at first: on the flanks of either set, or nearly level."""
    pairs = [flank(along) for along in (0, 1)]
    pairs += [replace(one, tilt=0.2, alpha_along=0.2, alpha_across=0.9) for one in pairs]
    return [
        replace(mixture, lobes=(*mixture.lobes, replace(one, color=(FAINT,) * 3))) for one in pairs
    ]

"""Compute the target of a fit: the radiance of the whole cloth, and of each thread that texels
resolve."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import surface
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.lookup import NO_THREAD, lookup, thread_number
from fabricusd.bake.texels.law_values import cloth_law, law_values
from fabricusd.fabric import Fabric, even
from fabricusd.materials.fit.judge import direction_pairs

Floats = NDArray[np.float64]

PLACES = 24
"""Number of positions along a thread's curve over which its radiance is averaged."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TexelSample:
    """Texels of one lay in the weave's frame, x along the weft, y along the warp.

    base : (k, 3); smooth, rough : (k,) - maps `roughness_along` and `_across`; opacity : (k,)
    normal : (k, 3) unit vectors
    tangent : (k, 3) unit vectors along the rougher axis, perpendicular to `normal`
    weight : (k,) share of the lay that each texel represents
    tint : (k, 3) factor on the reflection, or 1
    through : (k, 3) map `transmission_color`, or 0
    thread : (k,) thread number as in the map `thread_id`; NO_THREAD for texels of no single thread
    """

    base: Floats
    smooth: Floats
    rough: Floats
    opacity: Floats
    normal: Floats
    tangent: Floats
    weight: Floats
    tint: Floats | float = 1.0
    through: Floats | float = 0.0
    thread: NDArray[np.int64] | int = NO_THREAD

    @property
    def threads(self) -> list[int]:
        """Numbers of the threads that have texels."""
        return [int(one) for one in np.unique(self.thread) if one != NO_THREAD]

    def part(self, chosen: slice) -> TexelSample:
        """Return some of the texels."""
        held = {f.name: getattr(self, f.name) for f in fields(self)}
        return TexelSample(
            **{n: v[chosen] if isinstance(v, np.ndarray) else v for n, v in held.items()}
        )

    @property
    def shares(self) -> dict[int, float]:
        """The share of the lay of each of `threads`."""
        return {one: float(self.weight @ (self.thread == one)) for one in self.threads}


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """Rows of radiance values that a fit is compared with.

    values : (rows, VIEWS * LIGHTS, 3) radiance per unit `L_i dwi`
    weight : (rows,) weight of each row
    members : (rows, k) weights of the texels whose weighted sum is compared with the row
    """

    values: Floats
    weight: Floats
    members: Floats

    def row(self, number: int) -> Target:
        """Return a target of one of the rows."""
        one = slice(number, number + 1)
        return Target(values=self.values[one], weight=self.weight[one], members=self.members[one])


def target_of(fabric: Fabric, texels: TexelSample) -> Target:
    """Return the target of a fabric: level `far` in the first row, then a row for each thread.

    The row of a thread in `texels.threads` is the mean of level `weave` over the thread's area. All
    threads together have the same weight as the first row.
    """
    wi, wo = direction_pairs()
    shadow = surface.mean_shadow(fabric)
    values = [surface.evaluate(fabric, wi, wo, level="far", shadow=shadow)]
    members = [texels.weight]
    shares = []
    for one in texels.threads:
        mine = texels.weight * (texels.thread == one)
        shares.append(mine.sum())
        values.append(of_thread(fabric, one, wi, wo))
        # A thread's radiance refers to the area that it covers.
        members.append(mine / max(float(mine @ texels.opacity), 1e-9))
    weight = np.array([1.0, *(np.array(shares) / max(sum(shares), 1e-9))])
    return Target(values=np.stack(values), weight=weight, members=np.stack(members))


def of_thread(fabric: Fabric, number: int, wi: Floats, wo: Floats) -> Floats:
    """(n, 3) mean of level `weave` over the area of the thread `number` of map `thread_id`.

    The mean is that of even threads, which uneven ones keep.
    """
    fabric = even(fabric)
    rng = np.random.default_rng(0)
    places = rng.random((8192, 2)) * np.array(true_repeat(fabric))
    hit = lookup(fabric, places)
    mine = np.flatnonzero(thread_number(hit.set, hit.thread, len(fabric.threads)) == number)
    if not len(mine):
        return np.zeros_like(wi)
    # Radiance depends on the tangent angle alone, so uniform quantiles of it represent the area.
    order = mine[np.argsort(hit.angle[mine])]
    chosen = order[((np.arange(PLACES) + 0.5) / PLACES * len(order)).astype(int)]
    angles, count = np.repeat(hit.angle[chosen], len(wi)), len(chosen)
    lights, viewers = (np.tile(w.T, (1, count)) for w in (wi, wo))
    which, kind = int(hit.set[mine[0]]), int(hit.thread[mine[0]])
    found = law_values(cloth_law(fabric), which, kind, angles, lights, viewers)
    return np.asarray(found.reshape(3, count, len(wi)).mean(axis=1).T)

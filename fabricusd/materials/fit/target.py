"""What textures are to look like: the whole cloth, and each thread where texels resolve threads."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import surface
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.lookup import NO_THREAD, lookup, thread_number
from fabricusd.fabric import Fabric
from fabricusd.materials.fit.judge import direction_pairs

Floats = NDArray[np.float64]

PLACES = 24
"""Along a thread's curve, that its mean radiance is taken from."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TexelSample:
    """Texels of one lay in the weave's frame, x along the weft, y along the warp.

    base : (k, 3); smooth, rough : (k,) - maps `roughness_along` and `_across`; opacity : (k,)
    normal : (k, 3) unit; tangent : (k, 3) unit, along the rougher axis, across `normal`
    weight : (k,) share of the lay that each stands for
    tint : (k, 3) factor on the reflection, or 1
    thread : (k,) number of the thread in map `thread_id`, NO_THREAD for texels of none alone
    """

    base: Floats
    smooth: Floats
    rough: Floats
    opacity: Floats
    normal: Floats
    tangent: Floats
    weight: Floats
    tint: Floats | float = 1.0
    thread: NDArray[np.int64] | int = NO_THREAD

    @property
    def threads(self) -> list[int]:
        """Numbers of the threads that there are texels of."""
        return [int(one) for one in np.unique(self.thread) if one != NO_THREAD]

    def part(self, chosen: slice) -> TexelSample:
        """Some of the texels."""
        held = {f.name: getattr(self, f.name) for f in fields(self)}
        return TexelSample(
            **{n: v[chosen] if isinstance(v, np.ndarray) else v for n, v in held.items()}
        )

    @property
    def shares(self) -> dict[int, float]:
        """The share of the lay that each of `threads` has."""
        return {one: float(self.weight @ (self.thread == one)) for one in self.threads}


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """Rows of values, and what share each texel has in a row.

    values : (rows, VIEWS * LIGHTS, 3) radiance per unit `L_i dwi`
    weight : (rows,) how much a row counts
    members : (rows, k) sums of texels' values by these are what a row's values are compared with
    """

    values: Floats
    weight: Floats
    members: Floats

    def row(self, number: int) -> Target:
        """One of the rows alone."""
        one = slice(number, number + 1)
        return Target(values=self.values[one], weight=self.weight[one], members=self.members[one])


def target_of(fabric: Fabric, texels: TexelSample) -> Target:
    """Level `far` in the first row; then for each of `texels.threads` the mean of level `weave`
    over its places. All threads together count as much as the whole."""
    wi, wo = direction_pairs()
    values, members = [surface.evaluate(fabric, wi, wo, level="far")], [texels.weight]
    shares = []
    for one in texels.threads:
        mine = texels.weight * (texels.thread == one)
        shares.append(mine.sum())
        values.append(of_thread(fabric, one, wi, wo))
        # A thread's own radiance is that of what it covers.
        members.append(mine / max(float(mine @ texels.opacity), 1e-9))
    weight = np.array([1.0, *(np.array(shares) / max(sum(shares), 1e-9))])
    return Target(values=np.stack(values), weight=weight, members=np.stack(members))


def of_thread(fabric: Fabric, number: int, wi: Floats, wo: Floats) -> Floats:
    """(n, 3) mean of level `weave` over the places where a thread of map `thread_id` lies."""
    rng = np.random.default_rng(0)
    places = rng.random((8192, 2)) * np.array(true_repeat(fabric))
    hit = lookup(fabric, places)
    mine = np.flatnonzero(thread_number(hit.set, hit.thread, len(fabric.threads)) == number)
    if not len(mine):
        return np.zeros_like(wi)
    # A place matters by its tangent angle alone: even quantiles of it stand for all.
    order = mine[np.argsort(hit.angle[mine])]
    chosen = order[((np.arange(PLACES) + 0.5) / PLACES * len(order)).astype(int)]
    total = np.zeros_like(wi)
    for place in places[chosen]:
        total += surface.evaluate(fabric, wi, wo, place, "weave")
    return total / PLACES

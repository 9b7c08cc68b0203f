"""Light between the tubes: paths that start at the viewer, for any number of bounces.

    reflectance   radiance per unit `L_i dwi`, what `appearance.surface.evaluate` returns
    albedo        where the light goes: back, through, past the threads, lost

Published threads are brighter than white, so their light scatters once and what scatters again is
left out; `conserving` threads let it go on until it leaves. Each figure comes with its standard
error, from BATCHES independent sets of places.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from fabricusd.errors import FabricError
from fabricusd.geometry.cloth import Cloth
from fabricusd.geometry.rays import NOTHING, Hits, blocked, from_outside, nearest
from fabricusd.geometry.scatter import RANDOMS, arrive, go_on, pick_up
from fabricusd.kernels.real import KERNEL

Floats = NDArray[np.float64]
Sky = Callable[[Floats], Floats]

BATCHES = 8
BLOCK = 1 << 14
"""Paths that travel together: their state is 5 MB."""

BOUNCES = 500
ROULETTE = 4
"""Scatterings after which dim paths end at random."""

STEP = np.array([0.7548776662466927, 0.5698402909980532])
"""The plane's most even additive sequence [Roberts2018]: powers of the inverse plastic number."""


@dataclass(frozen=True, kw_only=True)
class Assumptions:
    """What geometry has to assume of a tube; how far figures move with each is its uncertainty.

    correlated : bool - surface light leaves at the mirror of where it came in; otherwise anywhere
    by_width : bool or None - a thread's light goes by the width that it shows there, and by its
        bend, which makes tubes reciprocal; None for `conserving` cloth only
    """

    correlated: bool = True
    by_width: bool | None = None


USUAL = Assumptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Reflectance:
    """value, error : (n, 3) float - radiance per unit `L_i dwi`, and its standard error; rays :
    int - how many were traced."""

    value: Floats
    error: Floats
    rays: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Shares:
    """Where the light goes that a viewer would see under a sky. Every share (n, 3), gap (n,).

    reflected, transmitted : to the viewer's side, to the other; after any number of scatterings
    reflected_once, transmitted_once : after one
    gap : what meets no thread
    lost : what ends inside a tube, where tubes overlap, or on the backing of pile
    left : what is still between the tubes after the last bounce; for published threads, what would
        scatter a second time
    error : standard error of reflected + transmitted
    rays : how many were traced
    """

    reflected: Floats
    transmitted: Floats
    reflected_once: Floats
    transmitted_once: Floats
    gap: Floats
    lost: Floats
    left: Floats
    error: Floats
    rays: int

    @property
    def total(self) -> Floats:
        """(n, 3) all of it: 1 where nothing is absorbed."""
        return np.asarray(
            self.reflected + self.transmitted + self.gap[:, None] + self.lost + self.left
        )


class Paths(NamedTuple):
    """origin, direction : (n, 3); throughput : (n, 3); group : (n,) - the figure they belong to."""

    origin: Floats
    direction: Floats
    throughput: Floats
    group: NDArray[np.int64]

    def only(self, keep: NDArray[np.bool_]) -> Paths:
        """Those that a mask chooses."""
        return Paths(
            self.origin[keep], self.direction[keep], self.throughput[keep], self.group[keep]
        )


def reflectance(
    cloth: Cloth,
    wo: ArrayLike,
    wi: ArrayLike,
    *,
    count: int = 1 << 14,
    bounces: int | None = None,
    seed: int = 0,
    assumptions: Assumptions = USUAL,
) -> Reflectance:
    """Radiance towards `wo` per unit `L_i dwi` from `wi`, the mean over the repeat, gaps included.

    wo, wi : (n, 3) or (3,) unit vectors in the surface frame; light may come from below
    count : paths a pair; bounces : scatterings at most, None for 1 where threads are published and
        for all of them where they are `conserving`

    Raises FabricError for directions that are not unit vectors or lie in the cloth's plane, and for
    a view of the back of a fabric whose back is another one.
    """
    viewers, lights = np.broadcast_arrays(directions("wo", wo), directions("wi", wi))
    _check_side(cloth, viewers)
    tracer = Tracer(cloth, assumptions, bounces_of(cloth, bounces), np.random.default_rng(seed))
    return tracer.reflectance(viewers, lights, count)


def albedo(
    cloth: Cloth,
    wo: ArrayLike,
    sky: Sky | None = None,
    *,
    count: int = 1 << 16,
    bounces: int | None = None,
    seed: int = 0,
    assumptions: Assumptions = USUAL,
) -> Shares:
    """What reaches viewers from a sky of radiance 1 all round, above and below, by its way.

    sky : directions (k, 3) -> (k,) radiance that is used in its place; None for 1
    The other arguments and errors are those of `reflectance`.
    """
    viewers = directions("wo", wo)
    _check_side(cloth, viewers)
    tracer = Tracer(cloth, assumptions, bounces_of(cloth, bounces), np.random.default_rng(seed))
    found = tracer.by_way(viewers, sky, count)
    mean, _ = mean_of(found)
    _, error = mean_of(found[:, :, 0] + found[:, :, 1])
    return Shares(
        **{name: mean[:, k] for k, name in enumerate(_WAYS[:-1])},
        gap=mean[:, len(_WAYS) - 1, 0],
        error=error,
        rays=tracer.rays,
    )


def radiance_at(
    cloth: Cloth,
    uv_threads: ArrayLike,
    wo: ArrayLike,
    wi: ArrayLike,
    *,
    bounces: int | None = None,
    seed: int = 0,
    assumptions: Assumptions = USUAL,
) -> Floats:
    """(n, 3) radiance towards `wo` per unit `L_i dwi` from `wi` at places of the cloth's top.

    uv_threads : (n, 2) float - in threads; wo, wi : (3,) unit vectors in the surface frame
    The other arguments and errors are those of `reflectance`; a place is traced once.
    """
    viewer, light = directions("wo", wo), directions("wi", wi)
    _check_side(cloth, viewer)
    uv = np.asarray(uv_threads, np.float64)
    tracer = Tracer(cloth, assumptions, bounces_of(cloth, bounces), np.random.default_rng(seed))
    found = []
    for begin in range(0, len(uv), BLOCK):
        part = uv[begin : begin + BLOCK] * cloth.pitch / cloth.patch.size
        towards = np.repeat(viewer, len(part), axis=0)
        paths = Paths(
            from_outside(cloth, part, towards), -towards, np.ones_like(towards),
            np.arange(len(part)),
        )  # fmt: skip
        found.append(tracer.gathered(paths, np.repeat(light, len(part), axis=0)))
    return np.concatenate(found)


_WAYS = (
    "reflected", "transmitted", "reflected_once", "transmitted_once", "lost", "left", "gap",
)  # fmt: skip
_REFLECTED, _TRANSMITTED, _R_ONCE, _T_ONCE, _LOST, _LEFT, _GAP = range(len(_WAYS))


def bounces_of(cloth: Cloth, bounces: int | None) -> int:
    """How often light scatters at most, given what was asked for."""
    if bounces is None:
        return BOUNCES if cloth.conserving else 1
    if bounces < 1:
        raise FabricError("bounces", f"is {bounces}; it must be at least 1")
    return bounces


def directions(name: str, w: ArrayLike) -> Floats:
    """(n, 3) unit vectors out of the cloth's plane."""
    rows = np.atleast_2d(np.asarray(w, np.float64))
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise FabricError(name, f"has shape {rows.shape}; it must be (n, 3)")
    length = np.linalg.norm(rows, axis=1)
    bad = ~(np.abs(length - 1) < 1e-3) | ~(np.abs(rows[:, 2]) > 1e-6)
    if bad.any():
        k = int(np.argmax(bad))
        raise FabricError(
            f"{name} {k}",
            f"is {rows[k].tolist()}; it must be a unit vector out of the plane of the cloth",
        )
    return np.asarray(rows / length[:, None])


def _check_side(cloth: Cloth, viewers: Floats) -> None:
    if cloth.fabric.opaque and (viewers[:, 2] < 0).any():
        raise FabricError(
            "wo",
            f"looks at the back of fabric '{cloth.fabric.name}', which is opaque: nothing is known "
            "of its backing; look from above",
        )
    if cloth.fabric.back is not None and (viewers[:, 2] < 0).any():
        raise FabricError(
            "wo",
            f"looks at the back of fabric '{cloth.fabric.name}', which is a fabric of its own; its "
            "tubes are not this one's turned over: build them from the back, or look from above",
        )


def mean_of(batches: Floats) -> tuple[Floats, Floats]:
    """Mean over axis 1 and its standard error."""
    spread = batches.std(axis=1, ddof=1) / np.sqrt(batches.shape[1])
    return batches.mean(axis=1), spread


class Tracer:
    """Traces blocks of paths through one cloth; counts its rays."""

    def __init__(
        self, cloth: Cloth, assumptions: Assumptions, bounces: int, rng: np.random.Generator
    ) -> None:
        self.cloth, self.bounces, self.rng = cloth, bounces, rng
        self.correlated = assumptions.correlated
        by_width = assumptions.by_width
        self.by_width = cloth.conserving if by_width is None else by_width
        self.rays = 0

    def reflectance(self, viewers: Floats, lights: Floats, count: int) -> Reflectance:
        """Of pairs of directions, (n, 3) each, a block of paths after another."""
        each = max(1, BLOCK // count)
        found = np.concatenate(
            [
                self.lit(viewers[k : k + each], lights[k : k + each], count)
                for k in range(0, len(viewers), each)
            ]
        )
        value, error = mean_of(found)
        return Reflectance(value=value, error=error, rays=self.rays)

    def by_way(self, viewers: Floats, sky: Sky | None, count: int) -> Floats:
        """`escaped`, a block of paths after another."""
        each = max(1, BLOCK // count)
        blocks = range(0, len(viewers), each)
        return np.concatenate([self.escaped(viewers[k : k + each], sky, count) for k in blocks])

    def lit(self, viewers: Floats, lights: Floats, count: int) -> Floats:
        """(n, BATCHES, 3) radiance towards each viewer from each light."""
        paths = self._start(viewers, count)
        per = len(paths.group) // len(viewers) // BATCHES
        out = self.gathered(paths, np.repeat(lights, BATCHES, axis=0))
        return out.reshape(len(viewers), BATCHES, 3) / per

    def gathered(self, paths: Paths, towards: Floats) -> Floats:
        """(g, 3) sums of what the paths of each group pick up from its light, `towards` (g, 3)."""
        out = np.zeros((len(towards), 3))
        for depth in range(self.bounces):
            hits = self._meet(paths)
            on = (hits.primitive != NOTHING) & ~hits.back
            paths, hits = paths.only(on), hits.only(on)
            if len(paths.group) == 0:
                break
            self._light(paths, hits, towards, out)
            if depth + 1 < self.bounces:
                paths = self._scattered(paths, hits, depth)
        return out

    def _light(self, paths: Paths, hits: Hits, towards: Floats, out: Floats) -> None:
        """Add to out (g, 3) what hits pick up from the lights `towards` (g, 3)."""
        n = len(paths.group)
        origin, value = np.empty((2 * n, 3)), np.empty((2, n))
        light = towards[paths.group]
        arrive(*self._scene(), *hits[:3], paths.direction, light, self.rng.random(n), origin, value)
        shadowed = np.ones(2 * n, np.bool_)
        # Most of a narrow lobe's light is nothing: no ray is needed to know that.
        asked = value.ravel() != 0
        self.rays += int(asked.sum())
        shadowed[asked] = blocked(self.cloth, origin[asked], np.concatenate((light, light))[asked])
        pick_up(
            self.cloth.lines, self.cloth.mesh.rings, self.cloth.threads, hits.primitive, value,
            shadowed, paths.throughput, paths.group, out,
        )  # fmt: skip

    def escaped(self, viewers: Floats, sky: Sky | None, count: int) -> Floats:
        """(n, BATCHES, ways, 3) light by its way."""
        paths = self._start(viewers, count)
        per = len(paths.group) // len(viewers) // BATCHES
        up = np.repeat(np.sign(viewers[:, 2]), BATCHES)
        out = np.zeros((len(up), len(_WAYS), 3))
        for depth in range(self.bounces + 1):
            if len(paths.group) == 0:
                break
            hits = self._meet(paths)
            radiance = np.ones(len(paths.group)) if sky is None else sky(paths.direction)
            _sort(depth, paths, up, radiance, hits, out)
            on = (hits.primitive != NOTHING) & ~hits.back
            paths, hits = paths.only(on), hits.only(on)
            if depth < self.bounces:
                paths = self._scattered(paths, hits, depth)
            else:
                np.add.at(out[:, _LEFT], paths.group, paths.throughput)
        return out.reshape(len(viewers), BATCHES, len(_WAYS), 3) / per

    def _scene(self) -> tuple[object, ...]:
        cloth = self.cloth
        return cloth.mesh.rings, cloth.lines, cloth.threads, self.by_width, self.correlated

    def _start(self, viewers: Floats, count: int) -> Paths:
        """`count` paths a viewer, in BATCHES shifted copies of one even set of places."""
        per = max(1, count // BATCHES)
        shift = self.rng.random((len(viewers) * BATCHES, 1, 2))
        uv = (shift + np.arange(per)[:, None] * STEP) % 1.0
        group = np.repeat(np.arange(len(viewers) * BATCHES), per)
        towards = viewers[group // BATCHES]
        return Paths(
            from_outside(self.cloth, uv.reshape(-1, 2), towards),
            -towards,
            np.ones((len(group), 3)),
            group,
        )

    def _meet(self, paths: Paths) -> Hits:
        self.rays += len(paths.group)
        return nearest(self.cloth, paths.origin, paths.direction)

    def _scattered(self, paths: Paths, hits: Hits, depth: int) -> Paths:
        n = len(paths.group)
        onward = np.empty((n, 3))
        go_on(
            *self._scene(), *hits[:3], paths.direction, self.rng.random((n, RANDOMS)),
            paths.throughput, paths.origin, onward,
        )  # fmt: skip
        paths = Paths(paths.origin, onward, paths.throughput, paths.group)
        return self._survivors(paths, depth)

    def _survivors(self, paths: Paths, depth: int) -> Paths:
        """The paths that go on: after some scatterings, dim ones end at random."""
        brightest: Floats = np.asarray(np.abs(paths.throughput).max(axis=1))
        # The conditions are such that NaN goes on, and shows in the sums.
        if depth < ROULETTE:
            return paths.only(~(brightest <= 0.0))
        chance = np.minimum(brightest, 1.0)
        paths = paths.only(~(self.rng.random(len(chance)) >= chance))
        paths.throughput[:] /= np.minimum(np.abs(paths.throughput).max(axis=1), 1.0)[:, None]
        return paths


@njit(**KERNEL)
def _sort(depth, paths, up, radiance, hits, out):
    """Add the paths that end to their ways: out (groups, ways, 3)."""
    for k in range(paths.group.size):
        g = paths.group[k]
        if hits.primitive[k] != NOTHING:
            if hits.back[k]:
                for channel in range(3):
                    out[g, _LOST, channel] += paths.throughput[k, channel]
            continue
        if depth == 0:
            for channel in range(3):
                out[g, _GAP, channel] += radiance[k]
            continue
        same = paths.direction[k, 2] * up[g] > 0.0
        for channel in range(3):
            arrived = paths.throughput[k, channel] * radiance[k]
            out[g, _REFLECTED if same else _TRANSMITTED, channel] += arrived
            if depth == 1:
                out[g, _R_ONCE if same else _T_ONCE, channel] += arrived

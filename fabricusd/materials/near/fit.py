"""Find which threads make which lobes of a mixture, so that it holds near by.

The colour of a lobe on a part of the threads enters the radiance linearly. It is found by
`scipy.optimize.nnls` on the cube roots of the channels, which is close to delta E 2000, reweighted
until they are the mean. The means of the factors over the cloth are 1, so that the cloth from afar
stays what it was. The width of each lobe at a point is then sought on a grid.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from fabricusd.appearance.scattering.models import translucent
from fabricusd.bake.texels import reflectance
from fabricusd.fabric import Fabric
from fabricusd.materials.fit.judge import hemisphere
from fabricusd.materials.fit.models import sheen_value
from fabricusd.materials.lobes.colors import BEYOND_WHITE, REC_709
from fabricusd.materials.lobes.mixture import (
    EVEN,
    UPRIGHT,
    Mixture,
    reflected,
    view_factor,
    weight,
)
from fabricusd.materials.lobes.mixture import evaluate as evaluate_far
from fabricusd.materials.lobes.target import GRAZING, LIGHTS, fitted_directions
from fabricusd.materials.near.mixture import NearMixture, placed
from fabricusd.materials.near.parts import COUNT, LEAST, SETS, Parts, parts_of
from fabricusd.materials.near.points import Points, points_of, radiance
from fabricusd.run.blas import one_blas_thread

Floats = NDArray[np.float64]

EVERY = 11
"""Step through the pairs of directions that a mixture is fitted to; it shares no factor with the
number of lights, so that all lights are seen."""

ROUNDS, AGAIN = 8, 3
"""Rounds of reweighting, at first and after a change of widths."""

RIDGE = 2e-2
"""Weight of the likely factors, which decide where lobes cannot be told apart near by."""

MEAN = 1.0
"""Weight of the mean over the points, which is to be the far mixture; the points have 1."""

FAINT = 0.1
"""Likely factor of threads across a lobe's axis, before the mean is 1."""

BLACK = 0.008
"""Added to a channel under the cube root, whose slope would be infinite at 0."""

LEAST_ERROR = 0.01
"""Difference of cube roots, about one delta E, below which pairs count as squares."""

SHARES = (0.0, 0.08, 0.2, 0.4, 0.7, 1.0)
"""Widths that are tried, between that of the thread's own surface lobe and that of the mixture's
lobe: shares of the difference of their squares."""

SLOPE_WIDTH = 2.0**0.5
"""GGX width over the standard deviation of slopes, as in the maps of a bake."""


class Problem:
    """Mixtures near by against the points of one fabric.

    points, true : the points, and their (points, n, 3) radiance for the pairs wi, wo (n, 3)
    """

    def __init__(self, fabric: Fabric, far: Mixture) -> None:
        self.points = points_of(fabric)
        self.likely = _likely(far, parts_of(fabric))
        wi, wo = fitted_directions()
        steep = len(wi) - len(GRAZING) * LIGHTS
        self.wi, self.wo = wi[:steep:EVERY], wo[:steep:EVERY]
        self.true = radiance(fabric, self.points, self.wi, self.wo)
        self.far = evaluate_far(far, self.wi, self.wo)

    def solved(self, near: NearMixture, rounds: int) -> NearMixture:
        """Return `near` with better factors."""
        for _ in range(rounds):
            units = self._units(near)
            near = replace(near, factors=self._factors(near, units))
        return near

    def error(self, near: NearMixture) -> float:
        """Mean difference of cube roots, in percent of white."""
        units, part = self._units(near), self.points.part
        values = np.einsum("plnc,plc->pnc", units, near.factors[:, part].swapaxes(0, 1))
        off = np.abs(_root(values) - _root(np.pi * self.true)).mean(axis=(1, 2))
        share = self.points.weight / self.points.weight.sum()
        mean = np.einsum("p,pnc->nc", self.points.weight, values)
        apart = np.abs(_root(mean) - _root(np.pi * self.far)).mean()
        return float(100.0 * (share @ off + MEAN * apart))

    def _units(self, near: NearMixture) -> Floats:
        """(points, lobes + 2, n, 3) value of each summand whose factor is 1, times pi."""
        far, wi, wo = near.far, self.wi, self.wo
        seen = view_factor(far, wo)
        even = seen * np.maximum(wo[:, 2], EVEN) ** far.diffuse_power * wi[:, 2] / np.pi
        fuzz = seen * np.maximum(wo[:, 2], UPRIGHT) ** far.sheen_power
        fuzz = fuzz * sheen_value(far.sheen_roughness, wi, wo)
        texels = near.parts.at(self.points.thread_set, self.points.angle, self.points.part)
        out = np.empty((len(self.points.part), len(near.lobes) + 2, len(wi), 3))
        out[:, -2] = even[:, None] * np.array(far.diffuse)
        out[:, -1] = fuzz[:, None] * np.array(far.sheen)
        for number, (lobe, _) in enumerate(near.lobes):
            mine = placed(near, number, texels)
            for p, (tilt, alpha) in enumerate(zip(mine.tilt, mine.alpha, strict=True)):
                one = reflected(far.form, lobe, tilt, (alpha, lobe.alpha_across), wi, wo)
                unit = (seen * weight(lobe, one, wo))[:, None]
                more = 1.0 + unit * mine.color[p] * one.spared[:, None]
                out[p, number] = one.value[:, None] * unit * np.array(lobe.color) * more
        return np.pi * out

    def _factors(self, near: NearMixture, units: Floats) -> Floats:
        """(lobes + 2, 8, 3) factors that fit best, by the weights that the present ones imply."""
        count, points = units.shape[1], self.points
        part = points.part
        now = np.einsum("plnc,plc->pnc", units, near.factors[:, part].swapaxes(0, 1))
        weights = _secant(now, np.pi * self.true) * np.sqrt(points.weight)[:, None, None]
        mean, far = np.einsum("p,pnc->nc", points.weight, now), np.pi * self.far
        mean_weights = _secant(mean, far) * np.sqrt(MEAN * points.weight.sum())
        found = np.empty_like(near.factors)
        for c in range(3):
            square, right = np.zeros((count, COUNT) * 2), np.zeros((count, COUNT))
            for b in np.unique(part):
                mine = part == b
                rows = units[mine, :, :, c] * weights[mine, None, :, c]
                wanted = np.pi * self.true[mine, :, c] * weights[mine, :, c]
                square[:, b, :, b] += np.einsum("pkn,pln->kl", rows, rows)
                right[:, b] += np.einsum("pkn,pn->k", rows, wanted)
            whole = np.zeros((count, COUNT, len(far)))
            for p, b in enumerate(part):
                whole[:, b] += points.weight[p] * units[p, :, :, c] * mean_weights[:, c]
            square += np.einsum("kbn,ldn->kbld", whole, whole, optimize=True)
            right += whole @ (far[:, c] * mean_weights[:, c])
            found[:, :, c] = _least(square, right, near.parts.share, self.likely)
        return found


def _least(square: Floats, right: Floats, share: Floats, likely: Floats) -> Floats:
    """(k, 8) non-negative solution of the normal equations whose means over the parts are 1."""
    count = len(right)
    n = count * COUNT
    matrix, wanted = square.reshape(n, n), right.ravel()
    scale = max(float(np.trace(matrix)) / n, 1e-12)
    ridge = RIDGE * scale * np.tile(share, count)
    matrix = matrix + np.diag(ridge + 1e-9 * scale)
    root = np.linalg.cholesky(matrix).T
    y = np.linalg.solve(root.T, wanted + ridge * likely.ravel())
    means = np.kron(np.eye(count), share[None])
    firm = 1e3 * np.sqrt(scale)
    x, _ = nnls(
        np.concatenate((root, firm * means)), np.concatenate((y, np.full(count, firm))),
        maxiter=100 * n,
    )  # fmt: skip
    found = np.where(share > LEAST, x.reshape(count, COUNT), 0.0)
    return np.asarray(found / np.maximum(found @ share, 1e-9)[:, None])


def _likely(far: Mixture, parts: Parts) -> Floats:
    """(lobes + 2, 8) factors that are as good as any where lobes cannot be told apart near by:
    those of threads whose angles are like the lobe's tilt."""
    rows = []
    for lobe in far.lobes:
        for tilt in lobe.tilts:
            off = (parts.angle - tilt) ** 2 / (0.5 * lobe.alpha_along**2)
            rows.append(np.where(SETS == lobe.along, np.exp(-0.5 * np.minimum(off, 40.0)), FAINT))
    rows += [np.ones(COUNT)] * 2
    found = np.array(rows)
    return np.asarray(found / (found @ parts.share)[:, None])


def _root(values: Floats) -> Floats:
    """Cube roots of channels, beyond a display's white by a gentle slope."""
    beyond = values > 1.0
    shown = np.where(beyond, 1.0 + BEYOND_WHITE * (values - 1.0), np.maximum(values, 0.0))
    return np.asarray(np.cbrt(shown + BLACK))


def _secant(values: Floats, true: Floats) -> Floats:
    """Weights with which squares of differences sum to differences of cube roots."""
    apart, a, b = values - true, _root(values), _root(true)
    near = np.abs(apart) < 1e-6
    slope = np.where(near, 1.0 / (3.0 * b * b), (a - b) / np.where(near, 1.0, apart))
    return np.asarray(slope / np.sqrt(np.maximum(np.abs(a - b), LEAST_ERROR)))


@one_blas_thread()
def fit_near(fabric: Fabric, far: Mixture) -> NearMixture:
    """Return the mixture near by whose lobes are those of `far`."""
    parts = parts_of(fabric)
    lobes = [(one, tilt) for one in far.lobes for tilt in one.tilts]
    problem = Problem(fabric, far)
    near = NearMixture(
        far=far, parts=parts,
        factors=np.full((len(lobes) + 2, COUNT, 3), 1.0 / parts.share.sum()),
        own=np.array([_narrowest(fabric, problem.points, lobe.along) for lobe, _ in lobes]),
        through=_through(fabric, problem.points), tinted=_tinted(fabric, problem.points),
    )  # fmt: skip
    near = problem.solved(near, ROUNDS)
    first = near.own.copy()
    at = 0
    for lobe in far.lobes:
        both = slice(at, at + len(lobe.tilts))
        at = both.stop
        tried = []
        for share in SHARES:
            own = near.own.copy()
            narrow = min(first[both.start], lobe.alpha_along)
            own[both] = np.sqrt(narrow**2 + share * (lobe.alpha_along**2 - narrow**2))
            other = problem.solved(replace(near, own=own), AGAIN)
            tried.append((problem.error(other), share, other))
        near = min(tried, key=lambda one: one[:2])[2]
    return problem.solved(near, AGAIN)


def _narrowest(fabric: Fabric, points: Points, along: int) -> float:
    """Width of the surface lobe of the smoothest thread of a set; any for a set without threads."""
    kinds = np.unique(points.thread[points.thread_set == along])
    widths = [fabric.thread_list[k].gamma_surface for k in kinds]
    return SLOPE_WIDTH * min(widths, default=0.1)


def _through(fabric: Fabric, points: Points) -> Floats:
    """(8, 3) share of even light from behind that each part scatters through, over all views."""
    found = np.zeros((COUNT, 3))
    if not translucent(fabric):
        return found
    lights, views = hemisphere(48) * (1.0, 1.0, -1.0), hemisphere(12)
    wi, wo = np.tile(lights, (len(views), 1)), np.repeat(views, len(lights), axis=0)
    values = radiance(fabric, points, wi, wo)
    # An even sheet sends color cos_i/pi to every viewer.
    cosine = -wi[:, 2] / np.pi
    color = np.einsum("n,pnc->pc", cosine, values) / (cosine @ cosine)
    for b in range(COUNT):
        mine = points.part == b
        if mine.any():
            found[b] = np.average(color[mine], axis=0, weights=points.weight[mine])
    return np.clip(found, 0.0, 1.0)


def _tinted(fabric: Fabric, points: Points) -> Floats:
    """(2,) share of the volume term in what each set reflects, seen from above."""
    table = reflectance.reflectance_table(fabric)
    step = np.rint(np.degrees(points.angle)).astype(np.int64) + 90
    rows = table[points.thread_set, points.thread, step]
    volume = rows[:, reflectance.VOLUME : reflectance.VOLUME + 3] @ REC_709
    both = volume + rows[:, reflectance.SURFACE]
    found = np.zeros(2)
    for which in (0, 1):
        mine = points.thread_set == which
        total = float(points.weight[mine] @ both[mine])
        found[which] = float(points.weight[mine] @ volume[mine]) / total if total > 0 else 0.0
    return found

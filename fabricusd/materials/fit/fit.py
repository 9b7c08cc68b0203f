"""Fit the parameters of a standard surface to the cloth's reflectance by least squares.

The forward model is what a renderer shows: the mean of the surface model over texels, with each
texel's colour, roughness, normal and tangent from the bake. The mean is taken over all texels and
over those of each thread, see `target`. The solver minimises a smooth form of the score, see
`judge`. It starts from several looks, among them the textures alone, and the result with the best
score is kept. The solver is `scipy.optimize.least_squares`, after [Branch1999].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fabricusd.appearance.scattering.models import translucent
from fabricusd.appearance.weave.lookup import NO_THREAD
from fabricusd.fabric import Fabric
from fabricusd.materials.fit.forward import forward, frames_of
from fabricusd.materials.fit.judge import Judge, albedo, direction_pairs
from fabricusd.materials.fit.target import Target, TexelSample, target_of
from fabricusd.materials.fit.through import fit_through
from fabricusd.materials.networks.look import Look
from fabricusd.run.blas import one_blas_thread

Floats = NDArray[np.float64]

REGULAR = 0.2
"""Regularisation, so that parameters that the data do not determine keep their starting values: a
parameter that moves by its whole range costs as much as this delta E."""

MOST_IOR = 20.0
"""Largest index. Published threads reflect more than they get, and so flat towards grazing light,
that a fit wants a mirror's reflectance: at 20 it is .82 at normal incidence."""

FIRST, MORE, ROUNDS = 8, 8, 3
"""Solver steps from each start, then steps per round from the best look so far, and rounds."""


@dataclass(frozen=True, kw_only=True)
class Fitted:
    """A fitted look and its error against the cloth.

    delta_e, delta_e_95 : mean and 95th percentile of delta E 2000 over pairs of directions, in a
        light under which a white diffuser is white
    albedo : mean relative error of the directional albedo over all channels and views
    threads_delta_e : mean delta E 2000 of each thread's own texels; None unless texels resolve
        threads
    score : the value of `Judge.score`
    start_delta_e, start_score : the same figures for the textures without a fit
    pairs : number of pairs of directions
    through_delta_e, through_start_delta_e : mean delta E 2000 over as many pairs with the light
        behind the cloth, with and without the fit; None where no scattered light comes through
    """

    look: Look
    delta_e: float
    delta_e_95: float
    albedo: float
    threads_delta_e: float | None
    score: float
    start_delta_e: float
    start_score: float
    pairs: int
    through_delta_e: float | None = None
    through_start_delta_e: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the fit for JSON."""
        said = asdict(self)
        return {"parameters": said.pop("look"), **said}


@one_blas_thread()
def fit(
    kind: str, texels: TexelSample, fabric: Fabric, *, baked: TexelSample | None = None
) -> Fitted:
    """Return the look with which surface `kind`, one of `models.KINDS`, best matches `fabric`.

    baked : the texels of the bake, if `texels` were modified; the start figures refer to them

    The result is never worse than `texels` alone, neither in `Judge.score` nor in the mean delta E
    of the pairs.
    """
    found = _fitted(kind, texels, target_of(fabric, texels), _free(kind), baked or texels)
    if not translucent(fabric):
        return found
    through = fit_through(kind, texels, fabric, found.look)
    return replace(
        found,
        look=replace(found.look, transmission_scale=through.scale),
        through_delta_e=through.delta_e,
        through_start_delta_e=through.start_delta_e,
    )


@one_blas_thread()
def fit_threads(texels: TexelSample, fabric: Fabric) -> dict[int, Fitted]:
    """Fit a look of surface `openpbr` without fuzz to each thread that the texels resolve.

    All looks share one index of refraction, that of the strongest reflection; the tints of the
    others are reduced accordingly.
    """
    target, free = target_of(fabric, texels), _free("openpbr")[:5]
    found = {
        one: _fitted("openpbr", texels, target.row(row), free, texels)
        for row, one in enumerate(texels.threads, 1)
    }
    ior = max((one.look.specular_ior for one in found.values()), default=1.5)
    return {number: replace(one, look=_with_index(one.look, ior)) for number, one in found.items()}


def _with_index(look: Look, ior: float) -> Look:
    """Return a look with index `ior` and the same reflectance at normal incidence."""

    def normal(n: float) -> float:
        return ((n - 1.0) / (n + 1.0)) ** 2

    less = normal(look.specular_ior) / max(normal(ior), 1e-9)
    red, green, blue = (x * less for x in look.specular_tint)
    return replace(look, specular_ior=ior, specular_tint=(red, green, blue))


def with_threads(texels: TexelSample, looks: Mapping[int, Look]) -> TexelSample:
    """Multiply each texel by its thread's look; texels of no thread take the mean of the looks."""
    base, smooth, rough, tint = (np.ones((len(texels.base), c)) for c in (3, 1, 1, 3))
    numbers = np.broadcast_to(texels.thread, len(texels.base))
    factors = thread_factors(looks, texels.shares)
    for k, number in enumerate(numbers):
        row = factors.get(int(number), factors[NO_THREAD])
        base[k], smooth[k], rough[k], tint[k] = row[:3], row[3], row[4], row[5:]
    return replace(
        texels,
        base=np.minimum(texels.base * base, 1.0),
        smooth=np.minimum(texels.smooth * smooth[:, 0], 1.0),
        rough=np.minimum(texels.rough * rough[:, 0], 1.0),
        tint=tint,
    )


def thread_factors(looks: Mapping[int, Look], share: Mapping[int, float]) -> dict[int, Floats]:
    """(8,) factors of each thread: on the base colour, both roughnesses, and the tint.

    The entry NO_THREAD is the mean of all threads, weighted by their shares.
    """
    found = {
        one: np.array(
            (*look.base_color_scale, look.smooth_scale, look.rough_scale, *look.specular_tint)
        )
        for one, look in looks.items()
    }
    weight = np.array([share[one] for one in looks])
    mean = np.average(np.stack(list(found.values())), axis=0, weights=weight)
    return {**found, NO_THREAD: mean}


def _fitted(
    kind: str, texels: TexelSample, target: Target, free: tuple[_Free, ...], baked: TexelSample
) -> Fitted:
    judge = Judge(target.values, target.weight)
    values_of = _renderer(kind, texels, target)
    plain = values_of(Look())
    baked_alone = plain if baked is texels else _renderer(kind, baked, target)(Look())
    found, got, start = Look(), plain, judge.delta_e(plain)[0].mean()
    starts = _starts(target.values[0])
    if all(one.name != "fuzz_weight" for one in free):
        starts = tuple(replace(one, fuzz_weight=0.0) for one in starts)
    for look in _sought(free, values_of, judge, starts):
        values = values_of(look)
        nearer = judge.score(values) < judge.score(got)
        if nearer and judge.delta_e(values)[0].mean() <= start:
            found, got = look, values
    error = judge.delta_e(got)
    true = albedo(target.values[0])
    threads = float(target.weight[1:] @ error[1:].mean(axis=1)) if len(error) > 1 else None
    return Fitted(
        look=found,
        delta_e=float(error[0].mean()),
        delta_e_95=float(np.quantile(error[0], 0.95)),
        albedo=float(np.mean(np.abs(albedo(got[0]) / np.maximum(true, 1e-3) - 1.0))),
        threads_delta_e=threads,
        score=judge.score(got),
        start_delta_e=float(judge.delta_e(baked_alone)[0].mean()),
        start_score=judge.score(baked_alone),
        pairs=target.values.shape[1],
    )


def _renderer(kind: str, texels: TexelSample, target: Target) -> Callable[[Look], Floats]:
    """Return a function from a look to (rows, n, 3) values, with the rows of `target`."""
    frames = frames_of(texels)
    wi, wo = (np.einsum("kab,nb->kna", frames, w) for w in direction_pairs())
    return lambda look: np.einsum(
        "rk,knc->rnc", target.members, forward(kind, look, texels, wi, wo), optimize=True
    )


_BARE = {f.name: getattr(Look(), f.name) for f in fields(Look) if f.name != "fuzz_color"}
"""The parameters of the textures alone, except a colour that has no effect without fuzz."""


def _sought(
    free: tuple[_Free, ...],
    values_of: Callable[[Look], Floats],
    judge: Judge,
    starts: tuple[Look, ...],
) -> list[Look]:
    """Return candidate looks: each start improved by a few steps, then the best one refined."""
    low, high = (np.concatenate([np.atleast_1d(f.bound(end)) for f in free]) for end in (0, 1))

    def improved(first: Look, steps: int, less: Floats | float = 1.0) -> Look:
        x0 = np.clip(_pack(first, free), low + 1e-6, high - 1e-6)
        pull = REGULAR / ((high - low) * np.sqrt(len(x0)))

        def residuals(x: Floats) -> Floats:
            off = judge.residuals(values_of(_unpack(x, free, first)), less)
            return np.concatenate((off, pull * (x - x0)))

        best = least_squares(residuals, x0, bounds=(low, high), x_scale=0.1, max_nfev=steps)
        return _unpack(best.x, free, first)

    tried = [improved(first, FIRST) for first in starts]
    # Least squares favours the worst pairs. Reweighting [Holland1977] turns it towards the mean.
    for _ in range(ROUNDS):
        best = min(tried, key=lambda look: judge.score(values_of(look)))
        tried.append(improved(best, MORE, judge.evened(values_of(best))))
    # Also try looks between the textures alone and the end: a fit may improve one figure at
    # another's cost.
    plain, end = _pack(replace(tried[-1], **_BARE), free), _pack(tried[-1], free)
    between = [_unpack(plain + t * (end - plain), free, tried[-1]) for t in (0.25, 0.5, 0.75)]
    return [*tried, *between]


@dataclass(frozen=True)
class _Free:
    """A parameter to fit and its bounds."""

    name: str
    bounds: tuple[float, float]
    count: int = 1

    def bound(self, end: int) -> Floats:
        return np.full(self.count, self.bounds[end])


def _free(kind: str) -> tuple[_Free, ...]:
    common = (
        _Free("base_color_scale", (0.0, 4.0), 3),
        _Free("specular_ior", (1.0, MOST_IOR)),
        _Free("smooth_scale", (0.05, 3.0)),
    )
    if kind == "preview":
        return common
    found: tuple[_Free, ...] = (
        *common,
        _Free("rough_scale", (0.05, 3.0)),
        _Free("specular_tint", (0.0, 1.0), 3),
        _Free("fuzz_weight", (0.0, 1.0)),
        _Free("fuzz_roughness", (0.05, 1.0)),
    )
    if kind != "u3m":
        # The sheen of U3M has the hue of the base.
        found = (*found, _Free("fuzz_color", (0.0, 1.0), 3))
    return found


def bounds_met(kind: str, look: Look) -> list[str]:
    """Say which parameters of a fitted look are at a bound; a value without effect is none."""
    found = []
    for one in _free(kind):
        value, plain = (np.atleast_1d(getattr(x, one.name)) for x in (look, Look()))
        near = 1e-4 * (one.bounds[1] - one.bounds[0])
        for bound in one.bounds:
            if np.any((np.abs(value - bound) < near) & (np.abs(plain - bound) >= near)):
                found.append(f"{one.name} is at its bound, {bound:g}")
    return found


def _starts(target: Floats) -> tuple[Look, ...]:
    """Return the starting looks: weak reflection with much fuzz, the reverse, the textures alone.

    The fuzz takes the hue of the cloth averaged over all directions.
    """
    color = target.mean(axis=0)
    red, green, blue = (float(c) for c in color / max(float(color.max()), 1e-9))
    hue = (red, green, blue)
    soft = Look(specular_ior=1.4, fuzz_weight=0.3, fuzz_color=hue, fuzz_roughness=0.4)
    return soft, replace(soft, specular_ior=3.0, fuzz_weight=0.02), Look(fuzz_color=hue)


def _pack(look: Look, free: tuple[_Free, ...]) -> Floats:
    return np.concatenate([np.atleast_1d(getattr(look, f.name)) for f in free])


def _unpack(x: Floats, free: tuple[_Free, ...], start: Look) -> Look:
    values: dict[str, Any] = {}
    at = 0
    for one in free:
        part = x[at : at + one.count]
        values[one.name] = tuple(map(float, part)) if one.count > 1 else float(part[0])
        at += one.count
    return replace(start, **values)

"""Parameters of a standard surface, by least squares against the cloth's own reflectance.

The forward model is what a renderer shows: the mean over texels of the surface model with each
texel's own colour, roughness, normal and tangent, as the bake has them, over all texels and over
those of each thread, see `target`. What is least is a smooth form of what is judged, see `judge`;
of several starts, the textures alone among them, that is taken which is judged best. [Branch1999]
by `scipy.optimize.least_squares`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fabricusd.appearance.weave.lookup import NO_THREAD
from fabricusd.fabric import Fabric
from fabricusd.materials.fit.judge import Judge, albedo, direction_pairs
from fabricusd.materials.fit.models import Surface, evaluate
from fabricusd.materials.fit.target import Target, TexelSample, target_of
from fabricusd.materials.networks.look import Look

Floats = NDArray[np.float64]

REGULAR = 0.2
"""Pull of each parameter to its start, so that what the data cannot tell stays put: a parameter
that is off by all of its range costs as much as this delta E."""

FIRST, MORE, ROUNDS = 8, 8, 3
"""Steps from each start; and from what is best then, in as many rounds."""


@dataclass(frozen=True, kw_only=True)
class Fitted:
    """A fit and how far it is from the cloth.

    delta_e, delta_e_95 : mean and 95th percentile of delta E 2000 over the pairs of directions, in
        a light under which a white diffuser is white
    albedo : mean relative difference of the directional albedo, all channels and views
    threads_delta_e : mean delta E 2000 of each thread's own texels, where texels resolve threads
    score : what was least, `Judge.score`
    start_delta_e, start_score : the same of the textures as they are, without a fit
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

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        said = asdict(self)
        return {"parameters": said.pop("look"), **said}


def fit(
    kind: str, texels: TexelSample, fabric: Fabric, *, baked: TexelSample | None = None
) -> Fitted:
    """The `Look` with which `kind` (one of `models.KINDS`) over `texels` is nearest to `fabric`.

    baked : the textures as they were, where `texels` are no longer those; what the start is of

    Never worse than `texels` alone, by `Judge.score` and by the mean delta E of the pairs.
    """
    return _fitted(kind, texels, target_of(fabric, texels), _free(kind), baked or texels)


def fit_threads(texels: TexelSample, fabric: Fabric) -> dict[int, Fitted]:
    """A look of surface `openpbr` without fuzz for each thread that the texels resolve; their
    index is one, that of the strongest reflection, and the others' tints are weaker for it."""
    target, free = target_of(fabric, texels), _free("openpbr")[:5]
    found = {
        one: _fitted("openpbr", texels, target.row(row), free, texels)
        for row, one in enumerate(texels.threads, 1)
    }
    ior = max((one.look.specular_ior for one in found.values()), default=1.5)
    return {number: replace(one, look=_with_index(one.look, ior)) for number, one in found.items()}


def _with_index(look: Look, ior: float) -> Look:
    """The same reflection at normal incidence, by another index and tint."""

    def normal(n: float) -> float:
        return ((n - 1.0) / (n + 1.0)) ** 2

    less = normal(look.specular_ior) / max(normal(ior), 1e-9)
    red, green, blue = (x * less for x in look.specular_tint)
    return replace(look, specular_ior=ior, specular_tint=(red, green, blue))


def with_threads(texels: TexelSample, looks: Mapping[int, Look]) -> TexelSample:
    """Texels with their thread's look in them; those of no thread take the mean of the looks."""
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
    """By thread (8,): factors on base colour, both roughnesses, and the tint; the mean of all by
    their share under NO_THREAD."""
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
    """From a look to (rows, n, 3) values, rows as the target has them."""
    frames = _frames(texels)
    wi, wo = (np.einsum("kab,nb->kna", frames, w) for w in direction_pairs())
    return lambda look: np.einsum(
        "rk,knc->rnc", target.members, forward(kind, look, texels, wi, wo), optimize=True
    )


_BARE = {f.name: getattr(Look(), f.name) for f in fields(Look) if f.name != "fuzz_color"}
"""The textures alone, but for a colour that does not show without fuzz."""


def _sought(
    free: tuple[_Free, ...],
    values_of: Callable[[Look], Floats],
    judge: Judge,
    starts: tuple[Look, ...],
) -> list[Look]:
    """Looks of least squares: what each start leads to in a few steps, and the best one's end."""
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
    # Squares heed the worst pairs most. Reweighted [Holland1977], they go over to the mean itself.
    for _ in range(ROUNDS):
        best = min(tried, key=lambda look: judge.score(values_of(look)))
        tried.append(improved(best, MORE, judge.evened(values_of(best))))
    # On the way from the textures alone, for a surface that gains one figure at another's cost.
    plain, end = _pack(replace(tried[-1], **_BARE), free), _pack(tried[-1], free)
    between = [_unpack(plain + t * (end - plain), free, tried[-1]) for t in (0.25, 0.5, 0.75)]
    return [*tried, *between]


def forward(kind: str, look: Look, texels: TexelSample, wi: Floats, wo: Floats) -> Floats:
    """(k, n, 3) radiance of each texel; wi, wo : (k, n, 3) in each texel's frame."""
    one = np.ones((len(texels.base), 1))
    smooth = np.minimum((texels.smooth * look.smooth_scale) ** 2, 1.0)[:, None]
    rough = np.minimum((texels.rough * look.rough_scale) ** 2, 1.0)[:, None]
    if kind == "preview":
        rough = smooth
    made = Surface(
        base=np.minimum(texels.base * np.array(look.base_color_scale), 1.0)[:, None],
        ior=look.specular_ior * one,
        alpha_rough=np.maximum(rough, smooth),
        alpha_smooth=smooth,
        tint=(np.ones((len(one), 3)) * texels.tint * np.array(look.specular_tint))[:, None],
        fuzz_weight=look.fuzz_weight * one,
        fuzz_color=np.array(look.fuzz_color)[None, None],
        fuzz_roughness=look.fuzz_roughness * one,
    )
    return np.asarray(evaluate(kind, made, wi, wo) * texels.opacity[:, None, None])


def _frames(texels: TexelSample) -> Floats:
    """(k, 3, 3) rows x (rougher axis), y, z (normal) of each texel."""
    z = texels.normal
    x = texels.tangent - np.sum(texels.tangent * z, axis=1, keepdims=True) * z
    x = x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-9)
    return np.stack((x, np.cross(z, x), z), axis=1)


@dataclass(frozen=True)
class _Free:
    """A parameter that is sought, and between which values."""

    name: str
    bounds: tuple[float, float]
    count: int = 1

    def bound(self, end: int) -> Floats:
        return np.full(self.count, self.bounds[end])


def _free(kind: str) -> tuple[_Free, ...]:
    common = (
        _Free("base_color_scale", (0.0, 4.0), 3),
        _Free("specular_ior", (1.0, 4.0)),
        _Free("smooth_scale", (0.05, 3.0)),
    )
    if kind == "preview":
        return common
    return (
        *common,
        _Free("rough_scale", (0.05, 3.0)),
        _Free("specular_tint", (0.0, 1.0), 3),
        _Free("fuzz_weight", (0.0, 1.0)),
        _Free("fuzz_roughness", (0.05, 1.0)),
    )


def _starts(target: Floats) -> tuple[Look, ...]:
    """Where the search begins: little reflection and much fuzz, the other way round, the textures
    alone. The fuzz keeps the hue that the cloth has over all directions."""
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

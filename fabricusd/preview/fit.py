"""Parameters of a standard surface, by least squares against the cloth's own reflectance.

The forward model is what a renderer shows from afar: the mean over texels of the surface model with
each texel's own colour, roughness, normal and tangent, as the bake has them. The target is level
`far`. What is least is a smooth form of what is judged, see `judge`; of several starts, the
textures alone among them, that is taken which is judged best. [Branch1999] by
`scipy.optimize.least_squares`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fabricusd.appearance import surface
from fabricusd.fabric import Fabric
from fabricusd.preview.judge import Judge, albedo, direction_pairs
from fabricusd.preview.look import Look
from fabricusd.preview.models import Surface, evaluate

Floats = NDArray[np.float64]

REGULAR = 0.2
"""Pull of each parameter to its start, so that what the data cannot tell stays put: a parameter
that is off by all of its range costs as much as this delta E."""

FIRST, MORE = 8, 40
"""Steps from each start, and from the one of them that is best then."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TexelSample:
    """Texels of one lay in the weave's frame, x along the weft, y along the warp.

    base : (k, 3); smooth, rough : (k,) - maps `roughness_along` and `_across`; opacity : (k,)
    normal : (k, 3) unit; tangent : (k, 3) unit, along the rougher axis, across `normal`
    weight : (k,) share of the lay that each stands for
    """

    base: Floats
    smooth: Floats
    rough: Floats
    opacity: Floats
    normal: Floats
    tangent: Floats
    weight: Floats


@dataclass(frozen=True, kw_only=True)
class Fitted:
    """A fit and how far it is from the cloth.

    delta_e, delta_e_95 : mean and 95th percentile of delta E 2000 over the pairs of directions, in
        a light under which a white diffuser is white
    albedo : mean relative difference of the directional albedo, all channels and views
    score : what was least, `Judge.score`
    start_delta_e, start_score : the same of the textures as they are, without a fit
    """

    look: Look
    delta_e: float
    delta_e_95: float
    albedo: float
    score: float
    start_delta_e: float
    start_score: float
    pairs: int

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        said = asdict(self)
        return {"parameters": said.pop("look"), **said}


def fit(kind: str, texels: TexelSample, fabric: Fabric) -> Fitted:
    """The `Look` with which `kind` (one of `models.KINDS`) over `texels` is nearest to `fabric`.

    Never worse than the textures alone, by `Judge.score` and by the mean delta E of the pairs.
    """
    wi, wo = direction_pairs()
    target = surface.evaluate(fabric, wi, wo, level="far")[None]
    judge = Judge(target, np.ones(1))
    frames = _frames(texels)
    locals_ = (np.einsum("kab,nb->kna", frames, wi), np.einsum("kab,nb->kna", frames, wo))

    def far(look: Look) -> Floats:
        return forward(kind, look, texels, *locals_)[None]

    plain = far(Look())
    start = judge.delta_e(plain)
    found, got = Look(), plain
    for look in _sought(kind, far, judge, target[0]):
        values = far(look)
        nearer = judge.score(values) < judge.score(got)
        if nearer and judge.delta_e(values).mean() <= start.mean():
            found, got = look, values
    error = judge.delta_e(got)
    true = albedo(target)
    return Fitted(
        look=found,
        delta_e=float(error.mean()),
        delta_e_95=float(np.quantile(error, 0.95)),
        albedo=float(np.mean(np.abs(albedo(got) / np.maximum(true, 1e-3) - 1.0))),
        score=judge.score(got),
        start_delta_e=float(start.mean()),
        start_score=judge.score(plain),
        pairs=len(wi),
    )


_BARE = {f.name: getattr(Look(), f.name) for f in fields(Look) if f.name != "fuzz_color"}
"""The textures alone, but for a colour that does not show without fuzz."""


def _sought(kind: str, far: Callable[[Look], Floats], judge: Judge, target: Floats) -> list[Look]:
    """Looks of least squares: what each start leads to in a few steps, and the best one's end."""
    free = _free(kind)
    low, high = (np.concatenate([np.atleast_1d(f.bound(end)) for f in free]) for end in (0, 1))

    def improved(first: Look, steps: int) -> Look:
        x0 = np.clip(_pack(first, free), low + 1e-6, high - 1e-6)
        pull = REGULAR / ((high - low) * np.sqrt(len(x0)))

        def residuals(x: Floats) -> Floats:
            off = judge.residuals(far(_unpack(x, free, first)))
            return np.concatenate((off, pull * (x - x0)))

        best = least_squares(residuals, x0, bounds=(low, high), x_scale=0.1, max_nfev=steps)
        return _unpack(best.x, free, first)

    begun = [improved(first, FIRST) for first in _starts(target)]
    best = improved(min(begun, key=lambda look: judge.score(far(look))), MORE)
    # On the way from the textures alone, for a surface that gains one figure at another's cost.
    plain, end = _pack(replace(best, **_BARE), free), _pack(best, free)
    between = [_unpack(plain + t * (end - plain), free, best) for t in (0.25, 0.5, 0.75)]
    return [*begun, best, *between]


def forward(kind: str, look: Look, texels: TexelSample, wi: Floats, wo: Floats) -> Floats:
    """(n, 3) mean radiance of the texels; wi, wo : (k, n, 3) in each texel's frame."""
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
        tint=np.array(look.specular_tint)[None, None],
        fuzz_weight=look.fuzz_weight * one,
        fuzz_color=np.array(look.fuzz_color)[None, None],
        fuzz_roughness=look.fuzz_roughness * one,
    )
    values = evaluate(kind, made, wi, wo) * texels.opacity[:, None, None]
    return np.asarray(np.einsum("k,knc->nc", texels.weight, values))


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

"""Parameters of a standard surface, by least squares against the cloth's own reflectance.

The forward model is what a renderer shows from afar: the mean over texels of the surface model with
each texel's own colour, roughness, normal and tangent, as the bake has them. The target is level
`far`. Residuals are differences of cube roots, which go with lightness, so that a highlight does
not outweigh everything else. [Branch1999] by `scipy.optimize.least_squares`.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fabricusd.appearance import surface
from fabricusd.color_difference import delta_e_2000
from fabricusd.fabric import Fabric
from fabricusd.preview.look import Look
from fabricusd.preview.models import Surface, evaluate

Floats = NDArray[np.float64]

DARK = 1e-3
"""Added before the cube root: differences below it are not seen."""

VIEWS, LIGHTS = 16, 96
"""Directions of the hemisphere, even in solid angle; the views reach down to 80 degrees."""

REGULAR = 0.01
"""Pull of each parameter to its start, so that what the data cannot tell stays put."""


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
    start_delta_e : `delta_e` of the textures as they are, without a fit
    """

    look: Look
    delta_e: float
    delta_e_95: float
    albedo: float
    start_delta_e: float
    pairs: int

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "parameters": asdict(self.look), "delta_e": self.delta_e,
            "delta_e_95": self.delta_e_95, "albedo": self.albedo,
            "start_delta_e": self.start_delta_e, "pairs": self.pairs,
        }  # fmt: skip


def hemisphere(count: int, lowest: float = 0.0) -> Floats:
    """(count, 3) unit vectors above z = `lowest`, even in solid angle: a Fibonacci spiral."""
    k = np.arange(count) + 0.5
    z = 1.0 - (1.0 - lowest) * k / count
    phi = k * np.pi * (3.0 - np.sqrt(5.0))
    r = np.sqrt(1.0 - z * z)
    return np.stack((r * np.cos(phi), r * np.sin(phi), z), axis=1)


def direction_pairs() -> tuple[Floats, Floats]:
    """(n, 3) wi and wo: each of VIEWS with each of LIGHTS."""
    views, lights = hemisphere(VIEWS, np.cos(np.radians(80.0))), hemisphere(LIGHTS)
    return np.tile(lights, (VIEWS, 1)), np.repeat(views, LIGHTS, axis=0)


def fit(kind: str, texels: TexelSample, fabric: Fabric) -> Fitted:
    """The `Look` with which `kind` (one of `models.KINDS`) over `texels` is nearest to `fabric`."""
    wi, wo = direction_pairs()
    target = surface.evaluate(fabric, wi, wo, level="far")
    frames = _frames(texels)
    locals_ = (np.einsum("kab,nb->kna", frames, wi), np.einsum("kab,nb->kna", frames, wo))
    free = _free(kind)
    start = _start(target)
    low, high = (np.concatenate([np.atleast_1d(f.bound(end)) for f in free]) for end in (0, 1))

    def far(x: Floats) -> Floats:
        return forward(kind, _unpack(x, free, start), texels, *locals_)

    root = np.cbrt(np.pi * target + DARK)
    albedo_root = np.cbrt(_albedo(target) + DARK)

    def residual(x: Floats, x0: Floats) -> Floats:
        got = far(x)
        return np.concatenate(
            (
                (np.cbrt(np.pi * got + DARK) - root).ravel() / np.sqrt(root.size),
                (np.cbrt(_albedo(got) + DARK) - albedo_root).ravel() / np.sqrt(albedo_root.size),
                REGULAR * (x - x0) / np.sqrt(len(x0)),
            )
        )

    tries = []
    for first in (start, replace(start, specular_ior=3.0, fuzz_weight=0.02)):
        x0 = np.clip(_pack(first, free), low + 1e-6, high - 1e-6)
        tries.append(
            least_squares(
                residual, x0, bounds=(low, high), x_scale=0.1, max_nfev=40, kwargs={"x0": x0}
            )
        )
    found = min(tries, key=lambda one: float(one.cost))
    look = _unpack(found.x, free, start)
    got, plain = far(found.x), forward(kind, Look(), texels, *locals_)
    error = _delta_e(got, target)
    return Fitted(
        look=look,
        delta_e=float(error.mean()),
        delta_e_95=float(np.quantile(error, 0.95)),
        albedo=float(np.mean(np.abs(_albedo(got) / np.maximum(_albedo(target), DARK) - 1.0))),
        start_delta_e=float(_delta_e(plain, target).mean()),
        pairs=len(wi),
    )


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


def _albedo(values: Floats) -> Floats:
    """(VIEWS, 3) integral over the lights of (VIEWS * LIGHTS, 3) values."""
    return np.asarray(values.reshape(VIEWS, LIGHTS, 3).mean(axis=1) * 2.0 * np.pi)


def _delta_e(got: Floats, target: Floats) -> Floats:
    """(n,) difference of the display colours under a light of irradiance pi."""
    pictures = [(np.pi * values)[None].astype(np.float32) for values in (got, target)]
    return np.asarray(delta_e_2000(*pictures)[0])


@dataclass(frozen=True)
class _Free:
    """A parameter that is sought. The pull of `REGULAR` counts in the units of `bounds`."""

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


def _start(target: Floats) -> Look:
    """Where the search begins, with little reflection and much fuzz; a second one begins the other
    way round. The fuzz keeps the hue that the cloth has over all directions."""
    color = target.mean(axis=0)
    color = tuple(float(c) for c in color / max(float(color.max()), 1e-9))
    return Look(specular_ior=1.4, fuzz_weight=0.3, fuzz_color=color, fuzz_roughness=0.4)


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

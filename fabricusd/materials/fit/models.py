"""Evaluate, in NumPy, the standard surface models that are fitted to fabrics.

The code follows the public definitions in MaterialX 1.39 ([MaterialX2024]: `bxdf/*.mtlx` and
`pbrlib/genglsl`), from which renderers generate their shaders: GGX with the Fresnel reflectance of
a dielectric or Schlick's approximation, height-correlated masking at the mean alpha, Turquin's
energy compensation, albedo-scaled layering, and sheen by [Zeltner2022] or Conty and Kulla.

All directions are in the texel's frame: x along the rougher axis, z the shading normal. Values are
radiance per unit `L dwi`, cosine included.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SMALLEST = 1e-6
"""Lower bound of cosines and alphas, MaterialX's M_FLOAT_EPS."""

KINDS = ("openpbr", "standard_surface", "gltf_pbr", "preview", "principled", "u3m")
"""Surfaces that can be evaluated. `preview` is UsdPreviewSurface in the metallic workflow with
metallic 0. `principled` is Blender's Principled BSDF, which differs from OpenPBR in its tint. `u3m`
is the Principled BSDF with what U3M can state of it."""

DISNEY = ("principled", "u3m")
"""Those whose tint colours normal incidence only, below a dielectric's reflectance."""

ZELTNER = ("openpbr", *DISNEY)
"""Those whose fuzz is that of [Zeltner2022]."""


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Parameters of a surface, each broadcast against the leading shape of the directions.

    base : (..., 3); ior : (...)
    alpha_rough, alpha_smooth : (...) GGX widths along x and y
    tint : (..., 3) factor on the specular reflection
    fuzz_weight, fuzz_roughness : (...); fuzz_color : (..., 3)
    """

    base: Floats
    ior: Floats
    alpha_rough: Floats
    alpha_smooth: Floats
    tint: Floats
    fuzz_weight: Floats
    fuzz_color: Floats
    fuzz_roughness: Floats


def evaluate(kind: str, s: Surface, wi: Floats, wo: Floats) -> Floats:
    """(..., 3) value for unit vectors wi, wo (..., 3); 0 if either is below the shading plane."""
    above = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    cos_i = np.clip(wi[..., 2], SMALLEST, 1.0)
    cos_o = np.clip(wo[..., 2], SMALLEST, 1.0)
    diffuse = s.base * (cos_i / np.pi)[..., None]
    spec, under_spec = specular(kind, s, wi, wo, cos_i, cos_o)
    if kind == "preview":
        out = spec + under_spec * diffuse
    elif kind == "standard_surface":
        fuzz, under_fuzz = conty_kulla(s, s.fuzz_roughness, wi, wo, cos_i, cos_o)
        out = spec + under_spec * (fuzz + under_fuzz[..., None] * diffuse)
    else:
        if kind in ZELTNER:
            fuzz, under_fuzz = zeltner(s, wi, wo, cos_o)
        else:
            fuzz, under_fuzz = conty_kulla(s, s.fuzz_roughness**2, wi, wo, cos_i, cos_o)
        out = fuzz + under_fuzz[..., None] * (spec + under_spec * diffuse)
    return np.where(above[..., None], out, 0.0)


def transmitted(kind: str, s: Surface, through: Floats, wi: Floats, wo: Floats) -> Floats:
    """(..., 3) value of a thin sheet below the layers, for light wi from below; 0 for any other.

    through : (..., 3) diffuse transmittance of the sheet
    """
    below = (wi[..., 2] < 0) & (wo[..., 2] > 0)
    cos_i = np.clip(-wi[..., 2], SMALLEST, 1.0)
    cos_o = np.clip(wo[..., 2], SMALLEST, 1.0)
    # What the layers leave depends on the view alone.
    above = wi * np.array((1.0, 1.0, -1.0))
    _, left = specular(kind, s, above, wo, cos_i, cos_o)
    if kind in ZELTNER:
        left = left * zeltner(s, above, wo, cos_o)[1][..., None]
    elif kind != "preview":
        rough = s.fuzz_roughness if kind == "standard_surface" else s.fuzz_roughness**2
        left = left * conty_kulla(s, rough, above, wo, cos_i, cos_o)[1][..., None]
    return np.where(below[..., None], left * through * (cos_i / np.pi)[..., None], 0.0)


def specular(
    kind: str, s: Surface, wi: Floats, wo: Floats, cos_i: Floats, cos_o: Floats
) -> tuple[Floats, Floats]:
    """(..., 3) GGX reflection, and the share (..., 1) of light that reaches the layer below."""
    h = wi + wo
    h = h / np.maximum(np.linalg.norm(h, axis=-1, keepdims=True), SMALLEST)
    ax = np.clip(s.alpha_rough, SMALLEST, 1.0)
    ay = np.clip(s.alpha_smooth, SMALLEST, 1.0)
    mean = np.sqrt(ax * ay)
    d = 1.0 / (
        np.pi * ax * ay * ((h[..., 0] / ax) ** 2 + (h[..., 1] / ay) ** 2 + h[..., 2] ** 2) ** 2
    )
    a2 = mean * mean
    lambda_i = np.sqrt(a2 + (1.0 - a2) * cos_i**2)
    lambda_o = np.sqrt(a2 + (1.0 - a2) * cos_o**2)
    g = 2.0 * cos_i * cos_o / (lambda_i * cos_o + lambda_o * cos_i)
    cos_h = np.clip(np.sum(wo * h, axis=-1), SMALLEST, 1.0)
    f0, fresnel, tint = _fresnel(kind, s, cos_h)
    whole = ggx_albedo(cos_o, mean, 1.0, 1.0)[..., None]
    gain = 1.0 + fresnel * (1.0 - whole) / whole
    albedo = ggx_albedo(cos_o[..., None], mean[..., None], f0, 1.0) * gain
    reduce = np.max if kind in DISNEY else np.mean
    albedo = reduce(albedo, axis=-1, keepdims=True)
    value = fresnel * gain * (d * g / (4.0 * cos_o))[..., None]
    return value * tint, 1.0 - albedo


def _fresnel(kind: str, s: Surface, cos_h: Floats) -> tuple[Floats, Floats, Floats]:
    """Return reflectance at normal incidence and at cos_h, and an overall factor: (..., 1 or 3)."""
    ior, c = s.ior[..., None], cos_h[..., None]
    f0 = ((ior - 1.0) / (ior + 1.0)) ** 2
    if kind in ("openpbr", "standard_surface"):
        return f0, dielectric_fresnel(c, ior), s.tint
    if kind in DISNEY:
        # The tint colours normal incidence only; beyond, reflectance rises as a dielectric's does.
        rise = (dielectric_fresnel(c, ior) - f0) / np.maximum(1.0 - f0, SMALLEST)
        tinted = f0 * s.tint
        return tinted, tinted + (1.0 - tinted) * rise, np.ones(1)
    # UsdPreviewSurface has no tint; that of glTF colours normal incidence only.
    tinted = f0 if kind == "preview" else np.minimum(f0 * s.tint, 1.0)
    return tinted, tinted + (1.0 - tinted) * (1.0 - c) ** 5, np.ones(1)


def dielectric_fresnel(c: Floats, ior: Floats) -> Floats:
    """Return the unpolarised Fresnel reflectance at cosine c."""
    g = np.sqrt(np.maximum(ior * ior + c * c - 1.0, 0.0))
    return np.asarray(
        0.5 * ((g - c) / (g + c)) ** 2 * (1.0 + (((g + c) * c - 1.0) / ((g - c) * c + 1.0)) ** 2)
    )


_ALBEDO = np.array(
    [
        [0.1003, 0.9345, 1.0, 1.0],
        [-0.6303, -2.323, -1.765, 0.2281],
        [9.748, 2.229, 8.263, 15.94],
        [-2.038, -3.748, 11.53, -55.83],
        [29.34, 1.424, 28.96, 13.08],
        [-8.245, -0.7684, -7.507, 41.26],
        [-26.44, 1.436, -36.11, 54.9],
        [19.99, 0.2913, 15.86, 300.2],
        [-5.448, 0.6286, 33.37, -285.1],
    ]
)
"""Rational fit of GGX's directional albedo, `mx_ggx_dir_albedo_analytic`."""


def ggx_albedo(x: Any, y: Any, f0: Any, f90: Any) -> Floats:
    """Return the directional albedo at cosine x and alpha y for reflectances f0 and f90."""
    x, y = np.broadcast_arrays(x, y)
    terms = (np.ones_like(x), x, y, x * y, x * x, y * y, x * x * y, x * y * y, x * x * y * y)
    r = sum(t[..., None] * row for t, row in zip(terms, _ALBEDO, strict=True))
    a = np.clip(r[..., 0] / r[..., 2], 0.0, 1.0)
    b = np.clip(r[..., 1] / r[..., 3], 0.0, 1.0)
    return np.asarray(f0 * a + f90 * b)


def zeltner(s: Surface, wi: Floats, wo: Floats, cos_o: Floats) -> tuple[Floats, Floats]:
    """(..., 3) sheen of [Zeltner2022], and the share of light that reaches the layer below."""
    albedo, value = _zeltner(s.fuzz_roughness, wi, wo, cos_o)
    share = s.fuzz_weight * albedo
    return (share * value)[..., None] * s.fuzz_color, 1.0 - share


def sheen_value(roughness: float, wi: Floats, wo: Floats) -> Floats:
    """(...) sheen of [Zeltner2022] alone, cosine included; 0 if either direction is below."""
    albedo, value = _zeltner(np.asarray(roughness), wi, wo, np.clip(wo[..., 2], SMALLEST, 1.0))
    return np.where((wi[..., 2] > 0) & (wo[..., 2] > 0), albedo * value, 0.0)


def _zeltner(roughness: Floats, wi: Floats, wo: Floats, cos_o: Floats) -> tuple[Floats, Floats]:
    """(...) directional albedo, and the distribution of the light that it reflects, to light wi."""
    x, y = cos_o, np.clip(roughness, 0.01, 1.0)
    sigma = y * (0.0206607 + 1.58491 * y) / (0.0379424 + y * (1.32227 + y))
    m = y * (-0.193854 + y * (-1.14885 + y * (1.7932 - 0.95943 * y * y))) / (0.046391 + y)
    o = y * (0.000654023 + (-0.0207818 + 0.119681 * y) * y) / (1.26264 + y * (-1.92021 + y))
    albedo = np.exp(-0.5 * ((x - m) / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi)) + o
    a = (2.58126 * x + 0.813703 * y) * y / (1.0 + 0.310327 * x * x + 2.60994 * x * y)
    b = (
        np.sqrt(1.0 - x)
        * (y - 1.0)
        * y**3
        / (0.0000254053 + 1.71228 * x - 1.71506 * x * y + 1.34174 * y * y)
    )
    flat = wo[..., :2]
    length = np.linalg.norm(flat, axis=-1)
    unit = np.where(
        length[..., None] > 1e-9, flat / np.maximum(length, 1e-9)[..., None], [1.0, 0.0]
    )
    along = np.sum(wi[..., :2] * unit, axis=-1)
    across = wi[..., 1] * unit[..., 0] - wi[..., 0] * unit[..., 1]
    z = wi[..., 2]
    square = (a * along + b * z) ** 2 + (a * across) ** 2 + z * z
    value = np.maximum(z, 0.0) / np.pi * (a / square) ** 2
    return np.asarray(albedo), np.asarray(value)


def conty_kulla(
    s: Surface, roughness: Floats, wi: Floats, wo: Floats, cos_i: Floats, cos_o: Floats
) -> tuple[Floats, Floats]:
    """(..., 3) sheen of Imageworks [Conty2017], and the share that reaches the layer below."""
    h = wi + wo
    h = h / np.maximum(np.linalg.norm(h, axis=-1, keepdims=True), SMALLEST)
    inverse = 1.0 / np.maximum(roughness, 0.005)
    sin2 = np.maximum(1.0 - h[..., 2] ** 2, 0.0)
    d = (2.0 + inverse) * sin2 ** (0.5 * inverse) / (2.0 * np.pi)
    value = d / (4.0 * (cos_i + cos_o - cos_i * cos_o)) * cos_i
    x, y = cos_o, roughness
    top = (
        13.673
        - 68.78018 * x
        + 799.08825 * y
        - 905.00061 * x * y
        + 60.28956 * x * x
        + 1086.96473 * y * y
    )
    low = (
        1.0
        + 61.57746 * x
        + 442.78211 * y
        + 2597.49308 * x * y
        + 121.81241 * x * x
        + 3045.55075 * y * y
    )
    albedo = np.clip(top / low, 0.0, 1.0)
    return (s.fuzz_weight * value)[..., None] * s.fuzz_color, 1.0 - s.fuzz_weight * albedo

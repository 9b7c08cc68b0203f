"""Hold the factors and constants that a fit adds to a material's textures."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Look:
    """Parameters of one surface model for one set of textures.

    base_color_scale : (3,) factor on the map `base_color`
    specular_ior : index of refraction of the reflecting layer. It is fitted and differs from the
        thread's: threads reflect more than a smooth dielectric
    specular_tint : (3,) factor on the reflection
    smooth_scale, rough_scale : factors on the maps `roughness_along` and `roughness_across`, whose
        squares are microfacet alphas
    fuzz_weight, fuzz_roughness, fuzz_color (3,) : the top layer
    transmission_scale : (3,) factor on the map `transmission_color`; None for cloth that lets no
        scattered light through
    """

    base_color_scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    specular_ior: float = 1.5
    specular_tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    smooth_scale: float = 1.0
    rough_scale: float = 1.0
    fuzz_weight: float = 0.0
    fuzz_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    fuzz_roughness: float = 0.5
    transmission_scale: tuple[float, float, float] | None = None

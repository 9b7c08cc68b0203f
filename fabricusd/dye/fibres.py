"""The scattering of fibres, for fabrics that users make: published fits of the same fibre."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fabricusd.fabric import DEGREE


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Index of refraction, isotropic share and lobe widths [degrees], and where they come from."""

    ior: float
    isotropic: float
    gamma_surface: float
    gamma_volume: float
    source: str

    def fields(self) -> dict[str, Any]:
        """The fields of a `Thread`."""
        return {
            "ior": self.ior,
            "isotropic": self.isotropic,
            "gamma_surface": self.gamma_surface * DEGREE,
            "gamma_volume": self.gamma_volume * DEGREE,
            "documentation": self.source,
        }


def _linen(why: str) -> Surface:
    return Surface(
        ior=1.46, isotropic=0.3, gamma_surface=12, gamma_volume=24,
        source=f"Scattering of linen, [Sadeghi2013] Table II{why}.",
    )  # fmt: skip


def _polyester(why: str) -> Surface:
    return Surface(
        ior=1.539, isotropic=0.7, gamma_surface=30, gamma_volume=60,
        source=f"Scattering of the twisted polyester thread of [Sadeghi2013] Table II{why}.",
    )  # fmt: skip


SURFACES = {
    "cotton": _linen(": cotton is cellulose too, and no fit of cotton is published"),
    "linen": _linen(""),
    "viscose": Surface(
        ior=1.53, isotropic=0.35, gamma_surface=4.9, gamma_volume=9.8,
        source="Scattering of rayon, derived from the pictures of [Bisker2011] chapter 3.",
    ),
    "silk": Surface(
        ior=1.345, isotropic=0.3, gamma_surface=18, gamma_volume=32,
        source="Scattering of the twisted silk thread of [Sadeghi2013] Table II.",
    ),
    "wool": Surface(
        ior=1.546, isotropic=0.6, gamma_surface=20, gamma_volume=40,
        source="Scattering of spun wool, derived from [Bisker2011] Table 3.2.",
    ),
    "polyester": _polyester(""),
    "nylon": _polyester(": no fit of nylon is published"),
    "acrylic": _polyester(": no fit of acrylic is published"),
    "acetate": _polyester(": no fit of acetate is published"),
}  # fmt: skip
"""Fibre, as in `weaves.yarn.FIBRES` -> how a thread of it scatters."""

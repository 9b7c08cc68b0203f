"""How near a mixture of lobes is to its fabric, for directions that it was not fitted to."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.fabric import Fabric
from fabricusd.materials.fit.judge import VIEWS, direction_pairs, hemisphere
from fabricusd.materials.lobes import skies
from fabricusd.materials.lobes.colors import REC_709
from fabricusd.materials.lobes.mixture import Mixture, evaluate
from fabricusd.materials.lobes.target import cloth
from fabricusd.quality.colors import delta_e_2000

Floats = NDArray[np.float64]

STEEP = (0.0, 20.0, 40.0, 55.0, 65.0, 72.0, 78.0, 82.0, 85.0, 87.0, 88.0, 89.0)
AROUND = 24
"""Views [degrees] and azimuths for which the albedos are compared."""


@dataclass(frozen=True, kw_only=True)
class Judged:
    """The error of a mixture.

    delta_e, delta_e_95 : mean and 95th percentile of delta E 2000 over the pairs of
        `fit.judge.direction_pairs`, none of which a mixture is fitted to
    sky_delta_e : mean delta E 2000 of the views under each of `skies.SKIES`
    sky_radiance : mean radiance of the views there over that of the cloth, less 1
    excess : how much brighter than the cloth the mixture is under an even sky, less 1, where that
        is most, for views to 89 degrees; luminance
    """

    delta_e: float
    delta_e_95: float
    sky_delta_e: dict[str, float]
    sky_radiance: dict[str, float]
    excess: float

    def as_dict(self) -> dict[str, Any]:
        """Return the figures for JSON."""
        return asdict(self)


class Judge:
    """Compares mixtures with one fabric."""

    def __init__(self, fabric: Fabric) -> None:
        self.pairs = direction_pairs()
        self.true = cloth(fabric, *self.pairs)
        self.views = hemisphere(VIEWS, float(np.cos(np.radians(80.0))))
        self.lights = skies.directions()
        self.under = self._of_views(self.views, lambda wi, wo: cloth(fabric, wi, wo))
        self.steep = _steep_views()
        self.albedo = self._luminance(lambda wi, wo: cloth(fabric, wi, wo))

    def __call__(self, mixture: Mixture) -> Judged:
        """Return the error of a mixture."""
        error = delta_e_2000(np.pi * evaluate(mixture, *self.pairs), np.pi * self.true)
        under = self._of_views(self.views, lambda wi, wo: evaluate(mixture, wi, wo))
        off, radiance = {}, {}
        for name in skies.SKIES:
            light = skies.radiance(name)
            mine, true = (np.einsum("l,vlc->vc", light, one) for one in (under, self.under))
            off[name] = float(delta_e_2000(mine, true).mean())
            radiance[name] = float((mine @ REC_709).mean() / (true @ REC_709).mean() - 1.0)
        albedo = self._luminance(lambda wi, wo: evaluate(mixture, wi, wo))
        return Judged(
            delta_e=float(error.mean()), delta_e_95=float(np.quantile(error, 0.95)),
            sky_delta_e=off, sky_radiance=radiance,
            excess=float(np.max(albedo / self.albedo) - 1.0),
        )  # fmt: skip

    def _of_views(self, views: Floats, value: Any) -> Floats:
        """(views, lights, 3) values."""
        return np.stack([value(self.lights, np.tile(v, (len(self.lights), 1))) for v in views])

    def _luminance(self, value: Any) -> Floats:
        """(steep views,) luminance under an even sky."""
        return np.asarray(self._of_views(self.steep, value).mean(axis=1) @ REC_709 * 2.0 * np.pi)


def _steep_views() -> Floats:
    polar, turn = np.meshgrid(np.radians(STEEP), 2.0 * np.pi * (np.arange(AROUND) + 0.3) / AROUND)
    s = np.sin(polar)
    w = np.stack((s * np.cos(turn), s * np.sin(turn), np.cos(polar)), axis=-1)
    return np.asarray(w.reshape(-1, 3))

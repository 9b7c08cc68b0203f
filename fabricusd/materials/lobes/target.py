"""The pairs of directions that a mixture of lobes is fitted to, and the cloth's radiance there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import surface
from fabricusd.fabric import Fabric
from fabricusd.materials.fit.judge import hemisphere

Floats = NDArray[np.float64]

VIEWS, LIGHTS, LOWEST = 28, 192, 81.0
"""Views down to LOWEST degrees, and lights for each of them, both uniform in solid angle. The
lights of each view are turned, so that no two views see the same ones."""

GRAZING = (84.0, 86.5, 89.0) * 4
"""Further views [degrees], which keep a mixture from growing bright where no pair would show it."""

_TURN = 0.5 * (np.sqrt(5.0) - 1.0)
"""Of successive views, and of their lights, in whole turns: the golden ratio spreads them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """Pairs of directions, LIGHTS for each view in turn, and the radiance of the cloth.

    wi, wo, values : (n, 3)
    views : number of views, the last len(GRAZING) of which are grazing
    """

    wi: Floats
    wo: Floats
    values: Floats
    views: int


def fitted_pairs(fabric: Fabric) -> Pairs:
    """Return the pairs that `fabric` is fitted to."""
    wi, wo = fitted_directions()
    return Pairs(wi=wi, wo=wo, values=cloth(fabric, wi, wo), views=VIEWS + len(GRAZING))


def fitted_directions() -> tuple[Floats, Floats]:
    """(n, 3) wi and wo of the pairs."""
    steep = hemisphere(VIEWS, float(np.cos(np.radians(LOWEST))))
    polar = np.radians(GRAZING)
    turn = 2.0 * np.pi * (0.06 + _TURN * np.arange(len(GRAZING)))
    flat = np.stack((np.cos(turn), np.sin(turn)), axis=1) * np.sin(polar)[:, None]
    views = np.concatenate((steep, np.column_stack((flat, np.cos(polar)))))
    lights = hemisphere(LIGHTS)
    wi = np.concatenate([turned(lights, (0.37 + k * _TURN) % 1.0) for k in range(len(views))])
    return wi, np.repeat(views, LIGHTS, axis=0)


def turned(w: Floats, turn: float) -> Floats:
    """(n, 3) directions turned about z by `turn` of a whole turn."""
    c, s = np.cos(2.0 * np.pi * turn), np.sin(2.0 * np.pi * turn)
    return np.asarray(w @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))


def cloth(fabric: Fabric, wi: Floats, wo: Floats) -> Floats:
    """(n, 3) radiance of the cloth from afar, with the law that it wears and its shadow."""
    return surface.evaluate(fabric, wi, wo, level="far", shadow="horizon")

"""A sum of tilted anisotropic microfacet lobes, a diffuse part and sheen, and its value.

With the normal `n = sin(tilt) a + cos(tilt) N` of a lobe whose threads run along `a`, and its
tangent `t = cos(tilt) a - sin(tilt) N`,

    f cos = V(wo) (sum color W D(h) G(wi, wo) / (4 n.wo)
                   + diffuse max(N.wo, 1e-4)^q N.wi / pi + sheen max(N.wo, 0.05)^u S)
    W = max(n.wo, 1e-4)^p max(1 - (t.wo)^2, 0.06)^r max(N.wo, 0.05)^s
        (1 + (rise - 1) (1 - h.wo)^e)

A lobe is 0 where either direction is below its plane or below the cloth. `D` is the distribution of
GGX, or that of Beckmann where a lobe is `gaussian`, which Cycles alone has. `S` is the sheen of
[Zeltner2022]. `V`, `view_factor`, keeps the mixture from being brighter than the cloth. `V` and the
powers of `W` depend on the viewer alone, because that is all that a closure's colour may depend on.

Renderers differ in the masking `G`. The masking of Cycles uses both widths of a lobe. MaterialX's
uses their geometric mean, and MaterialX adds the energy that is scattered more than once, which
depends on the reflectance `color W`. The last factor of `W` is the reflectance of MaterialX's
`generalized_schlick_bsdf`, by the angle between light and halfway vector; Cycles has no such lobe,
and its `rise` is 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.materials.fit.models import ggx_albedo, sheen_value

Floats = NDArray[np.float64]

CYCLES, MATERIALX = FORMS = ("cycles", "materialx")
"""Whose lobes the sum is made of."""

FACING, CROSSING, UPRIGHT, EVEN = 1e-4, 0.06, 0.05, 1e-4
"""Lower bounds of the bases of the powers p, r, s and u, and q. That of r keeps a lobe finite for a
viewer who looks along the thread."""

SMALLEST = 1e-6
"""Cosine below which a direction is below a plane."""


_LEVEL = 0.39
"""alpha^2 tan^2 below which Beckmann's masking is none: 1/1.6^2."""

SHARP = 0.01
"""Lower bound of N.wo in V."""

POWERS = 7
"""Number of coefficients of each polynomial of V."""


@dataclass(frozen=True, kw_only=True)
class Lobe:
    """A lobe, or two lobes of opposite tilt.

    along : 0 for threads along x, the weft; 1 for threads along y, the warp
    tilt : of the lobe's normal from N towards the thread's axis [rad]
    paired : whether there is another lobe whose tilt is the opposite
    alpha_along, alpha_across : widths along and across the thread; both distributions are alike
        near their peak, and have slopes of the variance alpha^2/2 where `gaussian`
    color : (3,) factor, not bounded by 1
    facing, crossing, upright : the powers p, r and s of W
    rise, rise_power : reflectance at grazing light over that face on, and its exponent e
    gaussian : whether D is that of Beckmann; of Cycles alone
    """

    along: int
    tilt: float
    paired: bool
    alpha_along: float
    alpha_across: float
    color: tuple[float, float, float]
    facing: float
    crossing: float
    upright: float
    rise: float = 1.0
    rise_power: float = 1.5
    gaussian: bool = False

    @property
    def tilts(self) -> tuple[float, ...]:
        """The tilt of each lobe."""
        return (self.tilt, -self.tilt) if self.paired else (self.tilt,)


OF_MATERIALX = ("rise", "rise_power")
"""Fields of a lobe that the form of Cycles does not have."""


@dataclass(frozen=True, kw_only=True)
class Mixture:
    """A sum of lobes.

    form : one of FORMS
    diffuse : (3,) factor on even reflection; diffuse_power : the power q
    sheen : (3,) factor on sheen of `sheen_roughness`; sheen_power : the power u
    view : (m POWERS,) coefficients of V, polynomial by polynomial, see `view_terms`; none: V is 1
    """

    form: str
    lobes: tuple[Lobe, ...]
    diffuse: tuple[float, float, float]
    diffuse_power: float
    sheen: tuple[float, float, float]
    sheen_roughness: float
    sheen_power: float
    view: tuple[float, ...] = ()

    @property
    def count(self) -> int:
        """Number of lobes, of which a pair is two."""
        return sum(len(one.tilts) for one in self.lobes)


class Reflected(NamedTuple):
    """One lobe of reflectance 1, without its weight, for n pairs of directions.

    value : (n,) D G / (4 n.wo), 0 below either plane
    facing, crossing, parted : (n,) bases of the powers p, r and e
    spared : (n,) light that a single scattering loses, (1 - E)/E; 0 except for MATERIALX
    """

    value: Floats
    facing: Floats
    crossing: Floats
    parted: Floats
    spared: Floats


def reflected(
    form: str, lobe: Lobe, tilt: Floats | float, alphas: tuple[Floats | float, Floats | float],
    wi: Floats, wo: Floats,
) -> Reflected:  # fmt: skip
    """Return a lobe for wi, wo (n, 3), with another tilt and widths along and across the thread."""
    along, (ax, ay) = lobe.along, alphas
    c, s = np.cos(tilt), np.sin(tilt)
    ti, to = c * wi[:, along] - s * wi[:, 2], c * wo[:, along] - s * wo[:, 2]
    ni, no = s * wi[:, along] + c * wi[:, 2], s * wo[:, along] + c * wo[:, 2]
    bi, bo = wi[:, 1 - along], wo[:, 1 - along]
    above = (ni > SMALLEST) & (no > SMALLEST) & (wi[:, 2] > 0) & (wo[:, 2] > 0)
    ni, no = np.where(above, ni, 1.0), np.where(above, no, 1.0)
    ht, hb, hn = ti + to, bi + bo, ni + no
    square = ht * ht + hb * hb + hn * hn
    slopes = (ht / ax) ** 2 + (hb / ay) ** 2
    if lobe.gaussian:
        level = np.maximum(hn**2, SMALLEST)
        d = np.exp(-slopes / level) * (square / level) ** 2 / (np.pi * ax * ay)
    else:
        d = square**2 / (np.pi * ax * ay * (slopes + hn**2) ** 2)
    if form == CYCLES:
        tan_i = ((ax * ti) ** 2 + (ay * bi) ** 2) / ni**2
        tan_o = ((ax * to) ** 2 + (ay * bo) ** 2) / no**2
        spared = np.zeros_like(d)
    else:
        tan_i, tan_o = (ax * ay * (1.0 / cos**2 - 1.0) for cos in (ni, no))
        single = ggx_albedo(np.minimum(no, 1.0), np.sqrt(ax * ay), 1.0, 1.0)
        spared = (1.0 - single) / single
    # [Heitz2014] eq. 99: height-correlated masking.
    hidden = _hidden_gaussian if lobe.gaussian else _hidden
    unmasked = 1.0 + hidden(tan_i) + hidden(tan_o)
    value = np.where(above, d / (4.0 * no * unmasked), 0.0)
    crossing = np.maximum(1.0 - to * to, CROSSING)
    parted = np.clip(1.0 - 0.5 * np.sqrt(square), 0.0, 1.0)
    return Reflected(value, np.maximum(np.where(above, no, 0.0), FACING), crossing, parted, spared)


def _hidden(tan: Floats) -> Floats:
    """Smith's Lambda of GGX by alpha^2 tan^2, [Heitz2014] eq. 72."""
    return np.asarray(0.5 * (np.sqrt(1.0 + tan) - 1.0))


def _hidden_gaussian(tan: Floats) -> Floats:
    """Smith's Lambda of Beckmann by alpha^2 tan^2: the rational approximation of [Walter2007] that
    Cycles evaluates too."""
    a = 1.0 / np.sqrt(np.maximum(tan, _LEVEL))
    return np.where(tan < _LEVEL, 0.0, (1.0 - a * (1.259 - 0.396 * a)) / (a * (3.535 + 2.181 * a)))


def weight(lobe: Lobe, one: Reflected, wo: Floats) -> Floats:
    """(n,) the factor W of a lobe."""
    upright = np.maximum(wo[:, 2], UPRIGHT)
    seen = one.facing**lobe.facing * one.crossing**lobe.crossing * upright**lobe.upright
    if lobe.rise != 1.0:
        seen = seen * (1.0 + (lobe.rise - 1.0) * one.parted**lobe.rise_power)
    return np.asarray(seen)


def view_terms(wo: Floats) -> Floats:
    """(n, 5 POWERS) factors of the coefficients of V: s^k times 1, d, d^2, x and y.

    x and y are the cosines of wo to the weft and the warp, `d = x^2 - y^2`, and s is the square
    root of N.wo, because the albedo of cloth changes fastest in grazing views.
    """
    s = np.sqrt(np.maximum(wo[:, 2], SHARP))
    x, y = wo[:, 0], wo[:, 1]
    d = x * x - y * y
    around = np.stack((np.ones_like(d), d, d * d, x, y), axis=1)
    powers = s[:, None] ** np.arange(POWERS)
    return np.asarray((around[:, :, None] * powers[:, None, :]).reshape(len(wo), -1))


def view_factor(mixture: Mixture, wo: Floats) -> Floats:
    """(n,) V of a mixture: the exponential of the sum of `view_terms` times the coefficients."""
    if not mixture.view:
        return np.ones(len(wo))
    return np.asarray(np.exp(view_terms(wo)[:, : len(mixture.view)] @ np.array(mixture.view)))


def evaluate(mixture: Mixture, wi: Floats, wo: Floats) -> Floats:
    """(n, 3) radiance per unit `L_i dwi` towards wo, cosine included, for unit wi, wo (n, 3).

    Directions are in the surface frame: x along the weft, y along the warp, z the normal. 0 if
    either is below the cloth.
    """
    seen = view_factor(mixture, wo)
    even = seen * np.maximum(wo[:, 2], EVEN) ** mixture.diffuse_power * wi[:, 2] / np.pi
    out = even[:, None] * np.array(mixture.diffuse)
    fuzz = seen * np.maximum(wo[:, 2], UPRIGHT) ** mixture.sheen_power
    fuzz = fuzz * sheen_value(mixture.sheen_roughness, wi, wo)
    out += fuzz[:, None] * np.array(mixture.sheen)
    for lobe in mixture.lobes:
        alphas = lobe.alpha_along, lobe.alpha_across
        for tilt in lobe.tilts:
            one = reflected(mixture.form, lobe, tilt, alphas, wi, wo)
            f = (seen * weight(lobe, one, wo))[:, None] * np.array(lobe.color)
            out += one.value[:, None] * f * (1.0 + f * one.spared[:, None])
    above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
    return np.where(above[:, None], out, 0.0)


def of_covered(mixture: Mixture, cover: float) -> Mixture:
    """Return the mixture per area of thread, for a surface whose opacity has the mean `cover`.

    A mixture is the radiance of the whole cloth, gaps included, and an opacity dims it once more.
    """
    view = mixture.view or (0.0,) * POWERS
    return replace(mixture, view=(view[0] - math.log(cover), *view[1:]))

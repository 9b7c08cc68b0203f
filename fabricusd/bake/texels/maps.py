"""Define the maps that can be baked: each is a registered function of a texel's moments.

Tangent-space maps are in the mesh's UV axes: x along increasing u, y along increasing v, z out of
the cloth. This is the frame of MikkTSpace tangents, whether or not a shell is mirrored. To add a
map, write its function here under `@texture_map` and add its row to docs/baking.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.lookup import NO_THREAD, thread_number
from fabricusd.bake.layout.garment import Lay
from fabricusd.bake.texels import moment_indices as m
from fabricusd.bake.texels.recipe import Recipe
from fabricusd.errors import FabricError, did_you_mean

Moments = NDArray[np.float32]

NO_LAY = 255
"""Lay number of a texel outside the UV layout."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Texels:
    """Texels of one lay at one mip level.

    moments : (MOMENTS, n) float32
    usual : (MOMENTS,) float32 - moments of the whole repeat; they replace those of a texel that
        shows no thread at all, so that a lookup between a thread and a gap finds the thread's
        values on both sides
    along : (2, 2) float64 - unit directions in UV of increasing U and V, as columns
    weave : (n, 2) float64 - weave coordinates of the centres, modulo the repeat
    hit : (set, thread), each (n,) - the thread under the centre, GAP if there is none
    types : number of thread types of the fabric
    lay : number of the lay
    """

    moments: Moments
    usual: Moments
    along: NDArray[np.float64]
    weave: NDArray[np.float64]
    hit: tuple[NDArray[Any], NDArray[Any]]
    types: int
    lay: int

    @classmethod
    def of_moments(cls, moments: Moments, recipe: Recipe, lay: Lay) -> Texels:
        """Return texels without weave coordinates, for maps that depend on the moments alone."""
        nothing: NDArray[Any] = np.empty(0, np.int32)
        return cls(
            moments=moments,
            usual=recipe.mean,
            along=lay.along,
            weave=np.empty((0, 2)),
            hit=(nothing, nothing),
            types=len(lay.fabric.threads),
            lay=-1,
        )

    def mean(self, moment: int, count: int = 1, covers: int = m.COVER) -> Moments:
        """(n, count) moments relative to the area of the threads, without the gaps.

        covers : the moment that holds that area
        """
        chosen = slice(moment, moment + count)
        cover, least = self.moments[covers], np.float32(1e-6)
        usual = self.usual[chosen] / np.maximum(self.usual[covers], least)
        shown = self.moments[chosen] / np.maximum(cover, least)
        return np.asarray(np.where(cover > least, shown, usual[:, None]).T)


Function = Callable[[Texels], NDArray[Any]]


@dataclass(frozen=True, kw_only=True)
class TextureMap:
    """A map of the registry.

    channels : names of the channels, as in EXR
    empty : value of texels outside the UV layout
    color : whether the map is a colour (linear Rec. 709) rather than data
    exact : stored as float32 instead of half; each level is point-sampled at its texels' centres
    needs_light : baked only if a light is given
    spare : baked only if it is requested by name
    of_light_through : baked only if it is requested by name or a fabric of the bake scatters light
        to its other side
    kind_of : the meaning of the numbers, which determines how they are compared and how they are
        encoded in 16 bits: "share" from 0 to 1, "direction", "axis" (a direction whose sign is
        arbitrary), "angle" in [-pi/2, pi/2], "id", "place" in the repeat, or any "number"
    unit : unit of the numbers, "" if they have none
    weight : weight of a texel's value in errors, (n,) or (n, channels); None for the cover of the
        threads
    """

    name: str
    function: Function
    channels: tuple[str, ...]
    empty: tuple[float, ...]
    meaning: str
    color: bool = False
    exact: bool = False
    needs_light: bool = False
    spare: bool = False
    of_light_through: bool = False
    kind_of: str = "share"
    unit: str = ""
    weight: Function | None = None

    @property
    def bytes_per_texel(self) -> int:
        """Bytes of a texel at the finest level, before compression."""
        return len(self.channels) * np.dtype(self.kind).itemsize

    @property
    def kind(self) -> type[Any]:
        """Number type of a channel in an EXR file."""
        return np.float32 if self.exact else np.float16


REGISTRY: dict[str, TextureMap] = {}


def texture_map(
    name: str, channels: str, empty: Sequence[float] = (0.0,), **options: Any
) -> Callable[[Function], Function]:
    """Register a function from n texels to (n, channels); its docstring is the map's meaning."""
    names = tuple(channels.split())

    def keep(function: Function) -> Function:
        REGISTRY[name] = TextureMap(
            name=name,
            function=function,
            channels=names,
            empty=tuple(empty) if len(empty) == len(names) else tuple(empty) * len(names),
            meaning=" ".join((function.__doc__ or "").split()),
            **options,
        )
        return function

    return keep


def chosen_maps(
    names: Sequence[str] | None, *, light: bool, through: bool = False
) -> list[TextureMap]:
    """Return the maps in `names`, in the registry's order; None selects all that can be baked.

    light : whether a light is given; through : whether light comes through a fabric of the bake
    """
    if names is None:
        return [
            t
            for t in REGISTRY.values()
            if (light or not t.needs_light) and (through or not t.of_light_through) and not t.spare
        ]
    unknown = [n for n in names if n not in REGISTRY]
    if unknown:
        raise FabricError(
            f"map '{unknown[0]}'",
            f"is unknown{did_you_mean(unknown[0], REGISTRY)}; it must be one of "
            f"{', '.join(REGISTRY)}",
        )
    for n in names:
        if REGISTRY[n].needs_light and not light:
            raise FabricError(f"map '{n}'", "needs a light; give one with --light X,Y,Z")
    return [t for t in REGISTRY.values() if t.name in names]


def _whole(t: Texels) -> NDArray[Any]:
    """Weight of maps whose values are meaningful in gaps as well."""
    return np.ones(t.moments.shape[1])


@texture_map("thread_id", "Y", (NO_THREAD,), exact=True, kind_of="id", weight=_whole)
def thread_id(t: Texels) -> NDArray[Any]:
    """Thread at the texel's centre: its type for weft, its type + types for warp, -1 for none"""
    return thread_number(*t.hit, t.types)[:, None]


@texture_map("lay", "Y", (NO_LAY,), exact=True, kind_of="id", weight=_whole)
def lay(t: Texels) -> NDArray[Any]:
    """Index in the manifest's lays (a fabric and its UV transform) of the texel; 255 for none"""
    return np.full((len(t.weave), 1), t.lay)


@texture_map("weave_coordinate", "R G", exact=True, kind_of="place", unit="threads", weight=_whole)
def weave_coordinate(t: Texels) -> NDArray[Any]:
    """Position of the texel's centre in the repeat, in threads: ends along U, picks along V; of
    uneven threads, the position at which even threads look as they do there"""
    return t.weave


@texture_map("base_color", "R G B", (0.5,), color=True)
def base_color(t: Texels) -> NDArray[Any]:
    """Reflectance of the threads' volume term seen from above, without the gaps"""
    return t.mean(m.VOLUME, 3)


@texture_map("transmission_color", "R G B", (0.0,), color=True, of_light_through=True)
def transmission_color(t: Texels) -> NDArray[Any]:
    """Share of the light from behind that the threads scatter through, seen from above, without
    the gaps"""
    return t.mean(m.THROUGH, 3)


@texture_map("back_base_color", "R G B", (0.5,), color=True, of_light_through=True)
def back_base_color(t: Texels) -> NDArray[Any]:
    """The map `base_color` of the cloth's back, seen from the back at the same place"""
    return t.mean(m.BACK_VOLUME, 3, m.BACK_COVER)


@texture_map("albedo", "R G B", (0.5,), color=True, weight=_whole)
def albedo(t: Texels) -> NDArray[Any]:
    """Reflectance of the cloth seen from above, surface and volume terms; gaps are black"""
    return np.asarray((t.moments[m.VOLUME : m.VOLUME + 3] + t.moments[m.SURFACE]).T)


@texture_map("specular_color", "R G B", (0.04,), color=True)
def specular_color(t: Texels) -> NDArray[Any]:
    """Fresnel reflectance of the threads at normal incidence"""
    return np.repeat(t.mean(m.FRESNEL), 3, axis=1)


def _slope_widths(t: Texels) -> tuple[NDArray[np.float64], ...]:
    """Return the mean slopes along U and V (2, n), their variances and their covariance (n,)."""
    mean = t.mean(m.SLOPE, 2).T.astype(np.float64)
    uu, vv, uv = t.mean(m.SLOPE_2, 3).T.astype(np.float64)
    return (
        mean,
        np.maximum(uu - mean[0] ** 2, 0.0),
        np.maximum(vv - mean[1] ** 2, 0.0),
        uv - mean[0] * mean[1],
    )


def _principal(t: Texels) -> tuple[NDArray[np.float64], ...]:
    """Return the smaller and larger principal variance of the slopes, and the angle [rad] of the
    smaller one's axis from U."""
    _, uu, vv, uv = _slope_widths(t)
    lobes = t.mean(m.LOBE_2, 2).T
    uu, vv = uu + lobes[0], vv + lobes[1]
    middle, half = 0.5 * (uu + vv), np.hypot(0.5 * (uu - vv), uv)
    wide = 0.5 * np.arctan2(2.0 * uv, uu - vv)
    return np.maximum(middle - half, 1e-8), np.maximum(middle + half, 1e-8), wide + 0.5 * math.pi


def _alpha(variance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert a slope variance to a microfacet alpha: Beckmann slopes have variance alpha^2/2."""
    return np.minimum(np.sqrt(2.0 * variance), 1.0)


@texture_map("roughness_along", "Y", (0.5,))
def roughness_along(t: Texels) -> NDArray[Any]:
    """Square root of the microfacet alpha along the map `tangent`, the smoother direction"""
    return np.sqrt(_alpha(_principal(t)[0]))[:, None]


@texture_map("roughness_across", "Y", (0.5,))
def roughness_across(t: Texels) -> NDArray[Any]:
    """Square root of the microfacet alpha across the map `tangent`, the rougher direction"""
    return np.sqrt(_alpha(_principal(t)[1]))[:, None]


@texture_map("anisotropy", "Y")
def anisotropy(t: Texels) -> NDArray[Any]:
    """1 - (alpha along)/(alpha across); 0 if isotropic"""
    narrow, wide, _ = _principal(t)
    return (1.0 - _alpha(narrow) / _alpha(wide))[:, None]


@texture_map("tangent", "R G B", (1.0, 0.0, 0.0), kind_of="axis", unit="degrees", weight=anisotropy)
def tangent(t: Texels) -> NDArray[Any]:
    """Direction of the smoother axis in UV axes, a unit vector whose sign is arbitrary"""
    angle = _principal(t)[2]
    flat = t.along @ np.stack((np.cos(angle), np.sin(angle)))
    flat /= np.maximum(np.linalg.norm(flat, axis=0), 1e-12)
    # Neighbouring texels can be interpolated if their signs are alike. Threads waver about the
    # directions of the sets, so the sign changes at the diagonal between these.
    flat *= np.where(t.along.sum(axis=1) @ flat < -1e-6, -1.0, 1.0)
    return np.stack((flat[0], flat[1], np.zeros_like(flat[0])), axis=1)


@texture_map("normal", "R G B", (0.0, 0.0, 1.0), kind_of="direction", unit="degrees")
def normal(t: Texels) -> NDArray[Any]:
    """Unit normal of the mean slope, in UV axes"""
    mean = _slope_widths(t)[0]
    flat = t.along @ -mean
    full = np.concatenate((flat, np.ones((1, flat.shape[1]))))
    return np.asarray((full / np.linalg.norm(full, axis=0)).T)


@texture_map("slope_variance", "R G B", kind_of="number")
def slope_variance(t: Texels) -> NDArray[Any]:
    """Variance of the slopes inside the texel along u, along v, and their covariance"""
    _, uu, vv, uv = _slope_widths(t)
    block = np.array([[uu, uv], [uv, vv]])
    turned = np.einsum("ai,ijn,bj->abn", t.along, block, t.along)
    limit = 6e4
    found = np.stack((turned[0, 0], turned[1, 1], turned[0, 1]), axis=1)
    return np.asarray(np.clip(found, -limit, limit))


@texture_map("height", "Y", kind_of="number", unit="mm")
def height(t: Texels) -> NDArray[Any]:
    """Mean height of the threads above their ends [mm], without the gaps"""
    return np.asarray(t.mean(m.HEIGHT) * np.float32(1e3))


@texture_map("opacity", "Y", weight=_whole)
def opacity(t: Texels) -> NDArray[Any]:
    """Share of the texel that is covered by threads; the rest is gap"""
    return np.asarray(t.moments[m.COVER][:, None])


@texture_map("visibility", "Y", (1.0,))
def visibility(t: Texels) -> NDArray[Any]:
    """Share of a cosine-weighted sky that neighbouring threads do not hide"""
    hidden = t.mean(m.HORIZON, m.AZIMUTHS) @ _sector()
    return np.asarray(np.clip(1.0 - hidden, 0.0, 1.0))[:, None]


def _sector() -> NDArray[np.float32]:
    """(AZIMUTHS,) share of the full circle that each azimuth of the horizon table represents."""
    # Azimuths are uniform in y/(|x| + |y|), so those near the diagonals represent less angle.
    places = (np.arange(m.AZIMUTHS + 1) - 0.5) * (4.0 / m.AZIMUTHS)
    quadrant, f = np.divmod(places, 1.0)
    edges = quadrant * (math.pi / 2) + np.arctan2(f, 1.0 - f)
    return (np.diff(edges) / (2.0 * math.pi)).astype(np.float32)


def _horizon(first: int) -> Function:
    def four(t: Texels) -> NDArray[Any]:
        return np.sqrt(np.maximum(t.mean(m.HORIZON + first, 4), 0.0))

    low, high = first * 22.5, (first + 3) * 22.5
    four.__doc__ = (
        f"Sine of the horizon's elevation towards azimuths {first} to {first + 3} of 16 "
        f"(about {low:g} to {high:g} degrees from U towards V), root mean square"
    )
    return four


for _first in range(0, m.AZIMUTHS, 4):
    texture_map(f"horizon_{_first:02d}", "R G B A")(_horizon(_first))


@texture_map("fuzz", "Y")
def fuzz(t: Texels) -> NDArray[Any]:
    """Reflectance that a view at 75 degrees gains over one from above; a diffuse base gains none"""
    return t.mean(m.FUZZ)


@texture_map("shadow", "Y", (1.0,), needs_light=True, weight=_whole)
def shadow(t: Texels) -> NDArray[Any]:
    """Share of the given light that arrives; gaps are lit"""
    return np.asarray(t.moments[m.LIT][:, None])


def _of_set(which: int, noun: str) -> None:
    """Register the maps from which the loader re-lights a thread set."""
    least = np.float32(1e-6)
    first = m.TINT + 3 * which

    def parts(t: Texels, moment: int) -> Moments:
        return t.moments[moment + m.PARTS * which : moment + m.PARTS * (which + 1)]

    def thread(t: Texels) -> NDArray[Any]:
        share = parts(t, m.SHARE).sum(axis=0)
        tint = t.moments[first : first + 3] / np.maximum(share, least)
        return np.concatenate((tint, share[None])).T

    def share(t: Texels) -> NDArray[Any]:
        return parts(t, m.SHARE).T

    def angle(t: Texels) -> NDArray[Any]:
        return np.asarray(parts(t, m.ANGLE) / np.maximum(parts(t, m.SHARE), least)).T

    def spread(t: Texels) -> NDArray[Any]:
        weight = np.maximum(parts(t, m.SHARE), least)
        mean, square = parts(t, m.ANGLE) / weight, parts(t, m.ANGLE_2) / weight
        return np.sqrt(np.maximum(square - mean * mean, 0.0)).T

    def lean(t: Texels) -> NDArray[Any]:
        weight = np.maximum(share(t).sum(axis=1), least)
        mean, square = (parts(t, p).sum(axis=0) / weight for p in (m.ANGLE, m.ANGLE_2))
        return np.stack((mean, np.sqrt(np.maximum(square - mean * mean, 0.0))), axis=1)

    def covered(t: Texels) -> NDArray[Any]:
        return share(t).sum(axis=1)

    by_part = "where it falls gently, falls steeply, rises gently, rises steeply along its axis"
    thread.__doc__ = f"`A` of the {noun} in the texel; alpha is the share that the {noun} covers"
    share.__doc__ = f"Share of the texel that the {noun} covers {by_part}"
    angle.__doc__ = f"Mean tangent angle [rad] of the {noun} {by_part}"
    spread.__doc__ = f"Standard deviation of the {noun}'s tangent angle [rad] {by_part}"
    lean.__doc__ = (
        f"Mean and standard deviation of the {noun}'s tangent angle [rad], over all parts"
    )
    by_angle: dict[str, Any] = {"kind_of": "angle", "unit": "rad"}
    texture_map(f"{noun}_thread", "R G B A", kind_of="number", weight=covered)(thread)
    texture_map(f"{noun}_share", "R G B A", weight=_whole)(share)
    texture_map(f"{noun}_angle", "R G B A", weight=share, **by_angle)(angle)
    texture_map(f"{noun}_spread", "R G B A", weight=share, **by_angle)(spread)
    texture_map(f"{noun}_lean", "R G", spare=True, weight=covered, **by_angle)(lean)


for _which, _noun in ((WEFT, "weft"), (WARP, "warp")):
    _of_set(_which, _noun)

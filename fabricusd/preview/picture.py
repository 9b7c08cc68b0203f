"""Picture of cloth on a shape, under one key light and a sky, without bounces.

At level `far` each pixel is shaded once, with the share of it that the shape covers; at `weave` and
`thread` each sample of each pixel looks up its thread. The key light is exact. The sky is a table
at `far`, and drawn directions at the other levels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.levels import LEVELS
from fabricusd.cache import kept
from fabricusd.errors import FabricError, did_you_mean
from fabricusd.fabric import Fabric
from fabricusd.images.view import View, encode
from fabricusd.kernels.cache import fingerprint
from fabricusd.preview.kernels.raster import NOTHING, frames, rasterise, reached
from fabricusd.preview.kernels.start import start
from fabricusd.preview.lights import Lights
from fabricusd.preview.occlusion import Visibility, shadow_map, sky_directions, visibility_of
from fabricusd.preview.shapes import SHAPES, Shape
from fabricusd.preview.surfaces import R4, SKY_DIRECTIONS, Cloth, Seen, Surface
from fabricusd.preview.tables import tables_of
from fabricusd.ranges import RANGES
from fabricusd.scene.scene import Camera

REAL: Any = np.float32
Reals = NDArray[np.float32]

SAMPLES = {"far": 8, "weave": 8, "thread": 8}
"""Samples of a pixel where none are asked for."""

BACKGROUND = 0.16
"""Radiance behind the shape in pictures without transparency."""

R2 = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps of the R2 sequence [Roberts2018]."""

SHADOW_SIZE = 1024
"""Texels of a shadow map along each side."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """A picture in scene-linear Rec. 709.

    radiance : (h, w, 3) float32, premultiplied by `cover`; cover : (h, w) float32
    """

    radiance: Reals
    cover: Reals

    def codes(self, exposure: float = 0.0, view: View | None = None) -> NDArray[np.uint8]:
        """(h, w, 3) 8-bit sRGB before a grey background; exposure in stops, see `images.view`."""
        ground = np.full(3, BACKGROUND * 2.0**-exposure)
        drawn = self.cover > 0
        codes = np.empty((*self.cover.shape, 3), np.uint8)
        # Most of a picture may be ground, and encoding takes as long as shading.
        codes[...] = encode(ground, exposure, view)
        behind = (1.0 - self.cover[drawn])[:, None] * ground
        codes[drawn] = encode(self.radiance[drawn] + behind, exposure, view)
        return codes

    def _repr_png_(self) -> bytes:
        """The picture as notebooks show it."""
        from fabricusd.preview.png import png_bytes

        return png_bytes(self.codes())


def preview(
    fabric: Fabric,
    *,
    shape: str = "cylinder",
    level: str | None = None,
    size: int = 512,
    lights: Lights = Lights(),  # noqa: B008
    samples: int | None = None,
) -> Picture:
    """Picture of `fabric` on one of `shapes.SHAPES`, size by size pixels.

    level : "far", "weave" or "thread"; None for `thread` on a swatch and `far` elsewhere
    samples : of each pixel; None for SAMPLES

    Raises FabricError for an unknown shape or level, and for numbers out of their range.
    """
    if shape not in SHAPES:
        hint = did_you_mean(shape, SHAPES)
        raise FabricError("shape", f"is '{shape}'; it must be one of {', '.join(SHAPES)}{hint}")
    level = level or ("thread" if shape == "swatch" else "far")
    require(level, size, size, samples)
    made = SHAPES[shape](fabric)
    return shaded(
        made, made.threads(fabric), made.camera(), [Cloth(tables_of(fabric))], level, (size, size),
        lights, samples or SAMPLES[level],
    )  # fmt: skip


def thumbnail(fabric: Fabric, size: int = 256) -> bytes:
    """PNG of a cylinder of `fabric`, for notebooks."""
    from fabricusd.preview.png import png_bytes

    return png_bytes(preview(fabric, size=size).codes())


def require(level: str, width: int, height: int, samples: int | None) -> None:
    """Raise FabricError for settings that no picture can be made with."""
    if level not in LEVELS:
        raise FabricError("level", f"is '{level}'; it must be one of {', '.join(LEVELS)}")
    for side in (width, height):
        RANGES["size"].require("size", side)
    if samples is not None:
        RANGES["samples"].require("samples", samples)


def shaded(
    shape: Shape,
    st: NDArray[np.float64],
    camera: Camera,
    surfaces: Sequence[Surface],
    level: str,
    size: tuple[int, int],
    lights: Lights,
    samples: int,
    material: NDArray[np.int32] | None = None,
) -> Picture:
    """Picture of a shape as `camera` sees it.

    st : (m, 3, 2) weave coordinates at the corners [threads]; size : (width, height)
    surfaces : what the triangles wear; material : (m,) index into it, None where it has one
    """
    start()
    scene = _Scene(shape, st, camera, size, lights)
    draw = _far if level == "far" else _near
    worn = _Worn(surfaces, material)
    if scene.map is not None:
        scene.open_sky(worn)
    radiance, cover = draw(scene, worn, level, samples)
    width, height = size
    return Picture(
        radiance=np.ascontiguousarray(radiance.T.reshape(height, width, 3), REAL),
        cover=np.ascontiguousarray(cover.reshape(height, width), REAL),
    )


class _Worn:
    """The surfaces of a shape's triangles."""

    def __init__(self, surfaces: Sequence[Surface], material: NDArray[np.int32] | None) -> None:
        self.surfaces, self.material = surfaces, material

    def radiance(
        self, triangles: NDArray[np.int32], seen: Seen, lights: Lights, level: str, numbers: Any
    ) -> Reals:
        """(3, n) radiance of what the pixels see; numbers : see `Surface`."""
        if self.material is None:
            return self.surfaces[0].radiance(seen, lights, level, numbers)
        out = np.zeros_like(seen.wi)
        which = self.material[triangles]
        for index in np.unique(which):
            mine = np.flatnonzero(which == index)
            own = None if numbers is None else numbers[:, mine]
            out[:, mine] = self.surfaces[index].radiance(seen.of(mine), lights, level, own)
        return out

    def value_far(self, triangles: NDArray[np.int64], wi: Reals, wo: Reals) -> Reals:
        """(n,) mean over the channels of the values at level `far`."""
        which = np.zeros(len(triangles), int) if self.material is None else self.material[triangles]
        found = np.zeros(len(triangles), REAL)
        for index in np.unique(which):
            mine = np.flatnonzero(which == index)
            i, o = (np.ascontiguousarray(w[:, mine]) for w in (wi, wo))
            found[mine] = self.surfaces[index].value_far(i, o).mean(axis=0)
        return found


class _Scene:
    """A shape before a camera, with the shadow map of the key light."""

    def __init__(
        self, shape: Shape, st: Any, camera: Camera, size: tuple[int, int], lights: Lights
    ) -> None:
        axes = shape.subject.axes
        self.shape, self.lights, self.size = shape, lights, size
        self.eye, self.up = camera.frame[:3, 3].copy(), axes[:, 1].copy()
        self.key = lights.direction(axes)
        self.corners = _corners(shape.points, camera, size)
        self.arrays = shape.points, shape.normals, shape.tangents, shape.hand, st
        self.radius = shape.subject.radius
        self.map: Any = None
        self.open: Any = None
        if not shape.convex:
            self.map = shadow_map(shape.points, self.key, SHADOW_SIZE)

    def open_sky(self, worn: _Worn) -> None:
        """Find how much of what each vertex would send of the sky reaches the viewer.

        The share is that of the light from `sky_directions` that arrives, weighted by the cloth's
        value at level `far`: cloth that shines at a grazing view lacks what it would mirror. The
        share does not depend on the key light, and is kept in the cache.
        """
        found = visibility_of(self.shape)
        sky = self.lights.even, self.lights.slope
        worn_by = () if worn.material is None else (worn.material,)
        surfaces = (part for surface in worn.surfaces for part in surface.identity())
        code = fingerprint(), Path(__file__).read_bytes()
        key = (*code, sky, self.eye, found.first, self.arrays[0], *worn_by, *surfaces)
        self.open = kept("open sky", key, lambda: self._open(found, worn))[found.vertex]

    def _open(self, found: Visibility, worn: _Worn) -> Reals:
        """(v,) share of the sky that reaches the vertices."""
        triangle, corner = found.first // 3, found.first % 3
        weights = np.stack((corner == 1, corner == 2), axis=-1).astype(REAL)
        share = np.ones(len(triangle), REAL)
        some = np.arange(len(triangle))
        axes = [self.seen(some, triangle, weights, key).wi for key in np.eye(3)]
        wo = self.seen(some, triangle, weights).wo
        some = np.flatnonzero(wo[2] > 0.0)
        wo = np.ascontiguousarray(wo[:, some])
        total, met = np.zeros(len(some), REAL), np.zeros(len(some), REAL)
        for k, towards in enumerate(sky_directions()):
            wi: Any = sum(axes[x][:, some] * REAL(towards[x]) for x in range(3))
            above = np.flatnonzero(wi[2] > 0.0)
            light = REAL(self.lights.even + self.lights.slope * float(towards @ self.up))
            value = worn.value_far(triangle[some[above]], wi[:, above], wo[:, above]) * light
            total[above] += value
            met[above] += value * found.arrives[some[above], k]
        share[some] = np.divide(met, total, out=np.ones_like(met), where=total > 0)
        return share

    def drawn(self, offset: Any) -> tuple[NDArray[np.int32], Reals]:
        """The triangle in each pixel and the place in it, as `rasterise`; both are flat."""
        width, height = self.size
        depth = np.full((height, width), np.inf)
        triangle = np.full((height, width), NOTHING, np.int32)
        weights = np.zeros((height, width, 2), REAL)
        rasterise(self.corners, float(offset[0]), float(offset[1]), depth, triangle, weights)
        return triangle.reshape(-1), weights.reshape(-1, 2)

    def seen(self, pixels: Any, triangle: Any, weights: Any, key: Any = None) -> Seen:
        """What the covered pixels see; key : (3,) instead of the direction to the key light."""
        n = len(pixels)
        wo, wi, sky = (np.empty((3, n), REAL) for _ in range(3))
        uv, place = np.empty((n, 2)), np.empty((n, 3), REAL)
        lift = 4.0 * self.radius / SHADOW_SIZE
        towards = self.key if key is None else key
        frames(
            self.arrays, self.eye, towards, self.up, lift, pixels, triangle, weights, wo, wi, sky,
            uv, place,
        )  # fmt: skip
        lit, reach = np.ones(n, REAL), np.ones(n, REAL)
        if self.open is not None:
            matrix, depth = self.map
            at = place @ matrix[:, :3].T.astype(REAL) + matrix[:, 3].astype(REAL)
            reached(depth, *(np.ascontiguousarray(at[:, k]) for k in range(3)), lit)
            near, corner = weights[pixels], self.open[triangle[pixels]]
            reach = (1.0 - near.sum(axis=1)) * corner[:, 0] + (near * corner[:, 1:]).sum(axis=1)
        return Seen(wo, wi, sky, uv, lit, reach)


def _corners(points: Any, camera: Camera, size: tuple[int, int]) -> NDArray[np.float64]:
    """(m, 3, 4) X, Y, W and Z of the corners, as `rasterise` takes them."""
    width, height = size
    frame = camera.frame
    local = (points - frame[:3, 3]) @ frame[:3, :3]
    scale = width / camera.aperture[0] * (1.0 if camera.orthographic else camera.focal_length)
    away = -local[..., 2]
    w = np.ones_like(away) if camera.orthographic else away
    shift = np.array(camera.aperture_offset) * width / camera.aperture[0]
    x = (0.5 * width - shift[0]) * w + scale * local[..., 0]
    y = (0.5 * height + shift[1]) * w - scale * local[..., 1]
    return np.ascontiguousarray(np.stack((x, y, w, away), axis=-1))


def _offset(number: int) -> Any:
    """(2,) place of a sample in a tent filter one pixel in radius, from the middle of the pixel."""
    u = (0.5 + number * R2) % 1.0
    return np.where(u < 0.5, np.sqrt(2.0 * u) - 1.0, 1.0 - np.sqrt(2.0 * (1.0 - u)))


def _far(scene: _Scene, worn: _Worn, level: str, samples: int) -> tuple[Any, Any]:
    """((3, h w) radiance, (h w,) cover): the sample nearest to its middle shades a pixel."""
    count = scene.size[0] * scene.size[1]
    triangle, weights = np.full(count, NOTHING, np.int32), np.zeros((count, 2), REAL)
    cover = np.zeros(count, REAL)
    for offset in sorted((_offset(k) for k in range(samples)), key=lambda d: float(d @ d)):
        found, place = scene.drawn(offset)
        cover += found != NOTHING
        new = (found != NOTHING) & (triangle == NOTHING)
        triangle[new], weights[new] = found[new], place[new]
    pixels = np.flatnonzero(triangle != NOTHING)
    seen = scene.seen(pixels, triangle, weights)
    radiance = np.zeros((3, count), REAL)
    cover /= samples
    value = worn.radiance(triangle[pixels], seen, scene.lights, level, None)
    radiance[:, pixels] = value * cover[pixels]
    return radiance, cover


def _near(scene: _Scene, worn: _Worn, level: str, samples: int) -> tuple[Any, Any]:
    """As `_far`, for the levels that look up the thread under each sample."""
    count = scene.size[0] * scene.size[1]
    radiance, cover = np.zeros((3, count), REAL), np.zeros(count, REAL)
    rotation = np.random.default_rng(0).random((4, count), np.float32)
    extent: Any = None
    for k in range(samples):
        triangle, weights = scene.drawn(_offset(k))
        pixels = np.flatnonzero(triangle != NOTHING)
        cover[pixels] += 1.0
        seen = scene.seen(pixels, triangle, weights)
        if extent is None:
            extent = _extent(seen.uv, pixels, scene.size)
        seen = replace(seen, extent=extent[pixels])
        step = (k * SKY_DIRECTIONS * R4).astype(REAL)
        numbers = rotation[:, pixels] + step[:, None]
        radiance[:, pixels] += worn.radiance(triangle[pixels], seen, scene.lights, level, numbers)
    return radiance / samples, cover / samples


def _extent(uv: Any, pixels: Any, size: tuple[int, int]) -> Reals:
    """(h w, 2) threads across each pixel, 0 where nothing is seen.

    uv : (n, 2) weave coordinates that the covered `pixels` see

    The differences to the nearer of two neighbours, along rows and along columns, are added: a seam
    or an edge beside a pixel does not count.
    """
    width, height = size
    held = np.full((height + 2, width + 2, 2), np.nan, REAL)
    # Differences of threads beyond millions would be lost in single precision.
    middle = uv.mean(axis=0) if len(uv) else 0.0
    held[1 + pixels // width, 1 + pixels % width] = uv - middle
    total = np.zeros((height, width, 2), REAL)
    for axis in (0, 1):
        step = np.abs(np.diff(held, axis=axis))
        step = step[:, 1:-1] if axis == 0 else step[1:-1]
        before, after = (step[:-1], step[1:]) if axis == 0 else (step[:, :-1], step[:, 1:])
        total += np.nan_to_num(np.fmin(before, after))
    return total.reshape(-1, 2)

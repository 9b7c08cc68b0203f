"""The shader of UsdPreviewSurface materials: a Lambertian base under a GGX specular layer.

The layer is the GGX model of [Walter2007] with height-correlated masking, sampled by visible
normals in the form of [Dupuy2023]. The diffuse part is scaled by the smaller Fresnel transmittance
of the two directions, which keeps it reciprocal and passive. `normal_map` may first turn the frame
in which the surface is shaded.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import INLINE, KERNEL, PART, cos, sin
from fabricusd.reference.rays.wave import (
    BLOCK,
    CHANCE,
    F_PDF,
    GO,
    GO_PDF,
    KEEP,
    MATERIAL,
    PLACE,
    THREAD,
    WEIGHT,
    WI,
    WO,
    F,
)
from fabricusd.scene.scene import PreviewSurface, Scene, Texture

R = np.float32
_PI = R(math.pi)

# Columns of the table of surfaces; each *_MAP is an index into the textures, or -1.
DIFFUSE, METALLIC, ROUGHNESS, IOR, OPACITY, THRESHOLD, EMISSIVE = 0, 3, 4, 5, 6, 7, 8
DIFFUSE_MAP, METALLIC_MAP, ROUGHNESS_MAP, OPACITY_MAP, EMISSIVE_MAP = 11, 12, 13, 14, 15
NORMAL_MAP, TRANSMISSION_MAP = 16, 17
TRANSMISSION = 18
COLUMNS = 21
_MAPS = {
    "diffuse": DIFFUSE_MAP, "metallic": METALLIC_MAP, "roughness": ROUGHNESS_MAP,
    "opacity": OPACITY_MAP, "emissive": EMISSIVE_MAP, "normal": NORMAL_MAP,
    "transmission": TRANSMISSION_MAP,
}  # fmt: skip
_WRAPS = ("repeat", "clamp", "mirror", "black")


class Surfaces(NamedTuple):
    """table : (materials, COLUMNS) float32; maps : (k, 6) int64 - start in `texels`, height, width,
    channels, wrap along u, wrap along v; places : (k, 6) float32 - `Texture.place`; texels : (t,)
    float32."""

    table: NDArray[np.float32]
    maps: NDArray[np.int64]
    places: NDArray[np.float32]
    texels: NDArray[np.float32]


def build_surfaces(scene: Scene) -> Surfaces:
    """Build the table with one row per material of the scene; the rows of fabrics stay empty."""
    table = np.zeros((max(len(scene.materials), 1), COLUMNS), np.float32)
    table[:, DIFFUSE_MAP:TRANSMISSION] = -1.0
    table[:, OPACITY] = 1.0
    maps: list[list[int]] = []
    places: list[tuple[float, ...]] = []
    pixels: list[NDArray[np.float32]] = []
    start = 0
    for row, surface in zip(table, scene.materials, strict=False):
        if not isinstance(surface, PreviewSurface):
            continue
        row[DIFFUSE : DIFFUSE + 3], row[EMISSIVE : EMISSIVE + 3] = surface.diffuse, surface.emissive
        row[METALLIC], row[ROUGHNESS], row[IOR] = surface.metallic, surface.roughness, surface.ior
        row[OPACITY], row[THRESHOLD] = surface.opacity, surface.opacity_threshold
        row[TRANSMISSION : TRANSMISSION + 3] = surface.transmission
        for name, column in _MAPS.items():
            texture = surface.textures.get(name)
            if texture is None:
                continue
            row[column] = len(maps)
            maps.append(_map_row(texture, start))
            places.append(texture.place)
            texels = np.asarray(texture.pixels, np.float32)
            if name == "normal":
                texels = along_the_mesh(texels, texture.place)
            pixels.append(texels.ravel())
            start += pixels[-1].size
    return Surfaces(
        table,
        np.array(maps, np.int64).reshape(-1, 6),
        np.array(places, np.float32).reshape(-1, 6),
        np.concatenate(pixels) if pixels else np.zeros(1, np.float32),
    )


def _map_row(texture: Texture, start: int) -> list[int]:
    h, w, c = texture.pixels.shape
    return [start, h, w, c, _WRAPS.index(texture.wrap[0]), _WRAPS.index(texture.wrap[1])]


def along_the_mesh(pixels: NDArray[np.float32], place: tuple[float, ...]) -> NDArray[np.float32]:
    """Convert (h, w, 3) normals from the axes of the picture to the mesh's u and v.

    place : `Texture.place`. If it rotates or mirrors the picture, the relief follows. A place that
        collapses the picture to a line leaves the normals unchanged.
    """
    a, b, _, d, e, _ = place
    mirrored = math.copysign(1.0, a * e - b * d)
    # The direction of increasing picture u in (u, v): the first column of the inverse.
    along, up = e * mirrored, -d * mirrored
    length = math.hypot(along, up)
    if a * e - b * d == 0 or length == 0 or (up == 0 and along > 0 and mirrored > 0):
        return pixels
    along, up = along / length, up / length
    x, y, z = np.moveaxis(pixels, -1, 0)
    return np.stack([along * x - mirrored * up * y, up * x + mirrored * along * y, z], axis=-1)


@njit(**INLINE)
def _wrapped(i, n, mode):
    """Texel index `i` wrapped into [0, n); -1 for black."""
    if mode == 0:
        return i % n
    if mode == 1:
        return min(max(i, 0), n - 1)
    if mode == 2:
        j = i % (2 * n)
        return min(j, 2 * n - 1 - j)
    return i if 0 <= i < n else -1


@njit(**PART)
def texture_at(surfaces, index, u, v):
    """Bilinear lookup of (r, g, b); v increases upwards from the bottom row."""
    m = surfaces.maps[index]
    start, h, w, channels = m[0], m[1], m[2], m[3]
    place = surfaces.places[index]
    u, v = place[0] * u + place[1] * v + place[2], place[3] * u + place[4] * v + place[5]
    x, y = u * R(w) - R(0.5), (R(1) - v) * R(h) - R(0.5)
    if not (abs(x) < R(1e8) and abs(y) < R(1e8)):
        return R(0), R(0), R(0)
    i, j = math.floor(x), math.floor(y)
    s, t = x - R(i), y - R(j)
    red, green, blue = R(0), R(0), R(0)
    for corner in range(4):
        di, dj = corner & 1, corner >> 1
        a, b = _wrapped(i + di, w, m[4]), _wrapped(j + dj, h, m[5])
        if a < 0 or b < 0:
            continue
        weight = (s if di else R(1) - s) * (t if dj else R(1) - t)
        k = start + (b * w + a) * channels
        red += weight * surfaces.texels[k]
        green += weight * surfaces.texels[k + (1 if channels > 1 else 0)]
        blue += weight * surfaces.texels[k + (2 if channels > 2 else 0)]
    return red, green, blue


@njit(**INLINE)
def opacity_at(surfaces, material, u, v):
    """Opacity at (u, v): the share of light that does not pass straight through."""
    row = surfaces.table[material]
    opacity = row[OPACITY]
    if row[OPACITY_MAP] >= R(0):
        opacity, _, _ = texture_at(surfaces, int(row[OPACITY_MAP]), u, v)
    if row[THRESHOLD] > R(0):
        return R(1) if opacity >= row[THRESHOLD] else R(0)
    return min(max(opacity, R(0)), R(1))


@njit(**INLINE)
def emission_at(surfaces, material, u, v):
    """Emitted radiance (r, g, b) at (u, v)."""
    row = surfaces.table[material]
    if row[EMISSIVE_MAP] >= R(0):
        return texture_at(surfaces, int(row[EMISSIVE_MAP]), u, v)
    return row[EMISSIVE], row[EMISSIVE + 1], row[EMISSIVE + 2]


@njit(**INLINE)
def fresnel(f0, f90, c):
    """Schlick's approximation at the cosine `c`."""
    d = R(1) - c
    d2 = d * d
    return f0 + (f90 - f0) * d2 * d2 * d


class Layers(NamedTuple):
    """The surface at a hit: base colour, metallic, the alpha of GGX, the reflectance at normal
    incidence, and the share of samples that the specular layer gets."""

    red: np.float32
    green: np.float32
    blue: np.float32
    metallic: np.float32
    alpha: np.float32
    f0: np.float32
    share: np.float32


@njit(**INLINE)
def evaluate(layers, wo, wi):
    """f times cosine (r, g, b) and pdf of `wi`; 0 unless both directions are above the surface."""
    red, green, blue, metallic, alpha, f0, share = layers
    (ox, oy, oz), (ix, iy, iz) = wo, wi
    hx, hy, hz = ix + ox, iy + oy, iz + oz
    inverse = R(1) / math.sqrt(max(hx * hx + hy * hy + hz * hz, R(1e-20)))
    hx, hy, hz = hx * inverse, hy * inverse, hz * inverse
    c = max(hx * ox + hy * oy + hz * oz, R(0))
    a2 = alpha * alpha
    # Written with the tangential components: a2 - 1 would cancel in float32 at small roughness.
    d = (hx * hx + hy * hy) + a2 * hz * hz
    distribution = a2 / max(_PI * d * d, R(1e-20))
    go = math.sqrt(a2 * (ox * ox + oy * oy) + oz * oz)
    gi = math.sqrt(a2 * (ix * ix + iy * iy) + iz * iz)
    # G2 / (4 cos_i cos_o) times cos_i, height-correlated.
    visible = R(0.5) * iz / max(iz * go + oz * gi, R(1e-20))
    specular = distribution * visible
    f90 = min(R(50) * f0, R(1))
    through = R(1) - max(fresnel(f0, f90, oz), fresnel(f0, f90, iz))
    diffuse = (R(1) - metallic) * through * iz / _PI
    dielectric = fresnel(f0, f90, c) * (R(1) - metallic)
    pdf = share * distribution / max(R(2) * (oz + go), R(1e-20)) + (R(1) - share) * iz / _PI
    above = iz > R(0) and oz > R(0)
    red = red * diffuse + specular * (dielectric + metallic * fresnel(red, R(1), c))
    green = green * diffuse + specular * (dielectric + metallic * fresnel(green, R(1), c))
    blue = blue * diffuse + specular * (dielectric + metallic * fresnel(blue, R(1), c))
    return (
        red if above else R(0), green if above else R(0), blue if above else R(0),
        pdf if above else R(0),
    )  # fmt: skip


@njit(**INLINE)
def sample(alpha, share, ox, oy, oz, u0, u1, u2):
    """Sample `wi`: by GGX visible normals with probability `share`, else by the cosine."""
    phi = R(2) * _PI * u1
    c, s = cos(R, phi), sin(R, phi)
    flat = math.sqrt(u2)
    sx, sy, sz = alpha * ox, alpha * oy, oz
    inverse = R(1) / math.sqrt(max(sx * sx + sy * sy + sz * sz, R(1e-20)))
    sx, sy, sz = sx * inverse, sy * inverse, sz * inverse
    z = (R(1) - u2) * (R(1) + sz) - sz
    r = math.sqrt(max(R(1) - z * z, R(0)))
    hx, hy, hz = alpha * (r * c + sx), alpha * (r * s + sy), max(z + sz, R(1e-7))
    inverse = R(1) / math.sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx * inverse, hy * inverse, hz * inverse
    d = R(2) * (hx * ox + hy * oy + hz * oz)
    even = u0 >= share
    return (
        flat * c if even else d * hx - ox,
        flat * s if even else d * hy - oy,
        math.sqrt(max(R(1) - u2, R(0))) if even else d * hz - oz,
    )


STEP = BLOCK + 16
"""Distance between rows of a block. Rows at a distance of a power of two would all map to the same
few cache lines."""

# Rows of a block: inputs from `Hits.rows`, the surface's properties at each hit, and the results.
(
    _O, _I, _CHANCE, RED_ROW, GREEN_ROW, BLUE_ROW, METALLIC_ROW, ALPHA_ROW, OPACITY_ROW, _F, _F_PDF,
    _GO, _WEIGHT, _GO_PDF,
) = (
    row * STEP for row in (0, 3, 6, 10, 11, 12, 13, 14, 15, 16, 19, 20, 23, 26)
)  # fmt: skip
ROWS = 27


@njit(**KERNEL)
def shade_preview(surfaces, hits, tags, first, last):
    """Evaluate and sample the surface at hits `first` to before `last`, all of one material.

    Fills rows F, F_PDF, GO, WEIGHT, GO_PDF, KEEP and THREAD, and updates the last row of CHANCE.
    """
    block = np.empty(ROWS * STEP, np.float32)
    row = surfaces.table[tags[MATERIAL, first]]
    f0 = (row[IOR] - R(1)) / (row[IOR] + R(1))
    f0 = f0 * f0
    for start in range(first, last, BLOCK):
        size = min(BLOCK, last - start)
        for row, count, place in ((WO, 3, _O), (WI, 3, _I), (CHANCE, 4, _CHANCE)):
            for k in range(count):
                source = hits[row + k][start:]
                for x in range(size):
                    block[place + k * STEP + x] = source[x]
        look_up(surfaces, tags[MATERIAL, first], hits, start, size, block)
        _shade(f0, size, block)
        for row, count, place in (
            (F, 3, _F), (GO, 3, _GO), (WEIGHT, 3, _WEIGHT), (F_PDF, 1, _F_PDF),
            (GO_PDF, 1, _GO_PDF), (KEEP, 1, OPACITY_ROW), (CHANCE + 3, 1, _CHANCE + 3 * STEP),
        ):  # fmt: skip
            for k in range(count):
                target = hits[row + k][start:]
                for x in range(size):
                    target[x] = block[place + k * STEP + x]
        thread = hits[THREAD][start:]
        for x in range(size):
            thread[x] = R(-1)


@njit(**PART)
def look_up(surfaces, material, hits, start, size, block):
    """Look up the surface's properties at each hit of a block."""
    row = surfaces.table[material]
    for x in range(size):
        block[RED_ROW + x], block[GREEN_ROW + x] = row[DIFFUSE], row[DIFFUSE + 1]
        block[BLUE_ROW + x], block[METALLIC_ROW + x] = row[DIFFUSE + 2], row[METALLIC]
        # A lobe of roughness below 0.02 is nearly a mirror; light sampling would make fireflies.
        block[ALPHA_ROW + x] = max(row[ROUGHNESS] * row[ROUGHNESS], R(4e-4))
        block[OPACITY_ROW + x] = min(max(row[OPACITY], R(0)), R(1))
    textured = row[OPACITY_MAP] >= R(0) or row[THRESHOLD] > R(0)
    if not textured and max(row[DIFFUSE_MAP], max(row[METALLIC_MAP], row[ROUGHNESS_MAP])) < R(0):
        return
    for x in range(size):
        u, v = hits[PLACE, start + x], hits[PLACE + 1, start + x]
        if row[DIFFUSE_MAP] >= R(0):
            red, green, blue = texture_at(surfaces, int(row[DIFFUSE_MAP]), u, v)
            block[RED_ROW + x], block[GREEN_ROW + x], block[BLUE_ROW + x] = red, green, blue
        if row[METALLIC_MAP] >= R(0):
            block[METALLIC_ROW + x], _, _ = texture_at(surfaces, int(row[METALLIC_MAP]), u, v)
        if row[ROUGHNESS_MAP] >= R(0):
            rough, _, _ = texture_at(surfaces, int(row[ROUGHNESS_MAP]), u, v)
            block[ALPHA_ROW + x] = max(rough * rough, R(4e-4))
        block[OPACITY_ROW + x] = opacity_at(surfaces, material, u, v)


@njit(**PART)
def _shade(f0, size, block):
    """Evaluate and sample a block in one loop without branches, which LLVM vectorises."""
    for x in range(size):
        red, green, blue = block[RED_ROW + x], block[GREEN_ROW + x], block[BLUE_ROW + x]
        metallic, alpha, opacity = (
            block[METALLIC_ROW + x],
            block[ALPHA_ROW + x],
            block[OPACITY_ROW + x],
        )
        ox, oy, oz = block[_O + x], block[_O + STEP + x], block[_O + 2 * STEP + x]
        gloss = metallic + (R(1) - metallic) * fresnel(f0, min(R(50) * f0, R(1)), oz)
        base = max(red, max(green, blue)) * (R(1) - metallic)
        share = gloss / max(gloss + base, R(1e-6))
        share = R(0) if gloss <= R(0) else min(max(share, R(0.1)), R(1))
        layers = Layers(red, green, blue, metallic, alpha, f0, share)
        wi = block[_I + x], block[_I + STEP + x], block[_I + 2 * STEP + x]
        fr, fg, fb, pdf = evaluate(layers, (ox, oy, oz), wi)
        block[_F + x], block[_F + STEP + x] = opacity * fr, opacity * fg
        block[_F + 2 * STEP + x], block[_F_PDF + x] = opacity * fb, opacity * pdf
        gx, gy, gz = sample(
            alpha, share, ox, oy, oz,
            block[_CHANCE + x], block[_CHANCE + STEP + x], block[_CHANCE + 2 * STEP + x],
        )  # fmt: skip
        wr, wg, wb, pdf = evaluate(layers, (ox, oy, oz), (gx, gy, gz))
        block[_GO + x], block[_GO + STEP + x], block[_GO + 2 * STEP + x] = gx, gy, gz
        inverse = R(1) / pdf if pdf > R(0) else R(0)
        block[_WEIGHT + x], block[_WEIGHT + STEP + x] = wr * inverse, wg * inverse
        block[_WEIGHT + 2 * STEP + x] = wb * inverse
        chance = block[_CHANCE + 3 * STEP + x]
        straight = chance >= opacity
        block[_GO_PDF + x] = R(-1) if straight else opacity * pdf
        block[_CHANCE + 3 * STEP + x] = chance if straight else chance / opacity

"""The last stage: adds the light of unblocked shadow rays, attenuated by see-through surfaces."""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.kernels.real import INLINE, LEAN, whole
from fabricusd.reference.rays.embree import (
    DX,
    DY,
    DZ,
    GEOMETRY,
    HIT_U,
    HIT_V,
    INFINITE_DISTANCE,
    MISS,
    OX,
    OY,
    OZ,
    PRIMITIVE,
    RAY_ROWS,
    TFAR,
    TNEAR,
)
from fabricusd.reference.rays.triangles import D1, D2, E1, E2, P0, ST
from fabricusd.reference.rays.wave import DIRECT, INDIRECT, LIT
from fabricusd.reference.surfaces.fabric_gap import BY_DIRECTION, gap_along
from fabricusd.reference.surfaces.preview import opacity_at

R = np.float32


FAINT = 0.2
"""Where less light than this passes a surface, chance decides whether a shadow ray goes on, with
the expected light unchanged: the ray would bring next to nothing. Linen, which passes a third,
would be noisier by it."""


def share_that_goes_on(most: float) -> np.float32:
    """The share of the blocked shadow rays that is looked at, if surfaces pass at most `most`."""
    return np.float32(most if most < FAINT else 1.0)


@njit(**LEAN)
def settle(count, shadows, film, aovs, go_on):
    """Add the light of the shadow rays that are not blocked, after `occluded`.

    go_on : `share_that_goes_on`: this share of the blocked rays, with as much more light, is packed
        to the front, ready for `intersect`, to see what passes
    Returns the number of rays that are packed.
    """
    rays, shadow, shadow_path = shadows
    bits = rays.view(np.uint32)
    left = 0
    for k in range(whole(count)):
        signed = shadow_path[k]
        p, lane = k >> 4, k & 15
        if rays[p, TFAR, lane] < R(0):
            if _chance(bits, p, lane, 0) < go_on:
                q, place = left >> 4, left & 15
                for row in range(RAY_ROWS):
                    rays[q, row, place] = rays[p, row, lane]
                for j in range(3):
                    shadow[j, left] = shadow[j, k] / go_on
                shadow[3, left] = shadow[3, k]
                shadow_path[left] = signed
                rays[q, TFAR, place] = shadow[3, left]
                bits[q, GEOMETRY, place] = MISS
                left += 1
            continue
        path, row = whole(signed if signed >= 0 else -1 - signed), DIRECT
        if signed < 0:
            row = INDIRECT
        if aovs and row == DIRECT:
            film[LIT, path] += shadow[0, k] + shadow[1, k] + shadow[2, k]
        film[row, path] += shadow[0, k]
        film[row + 1, path] += shadow[1, k]
        film[row + 2, path] += shadow[2, k]
    _close(rays, left)
    return left


@njit(**INLINE)
def _close(rays, count):
    """Switch off the lanes behind `count` rays."""
    for k in range(count, ((count + 15) >> 4) << 4):
        rays[k >> 4, TNEAR, k & 15] = R(0)
        rays[k >> 4, TFAR, k & 15] = R(-1)


@njit(**INLINE)
def _chance(bits, p, lane, number):
    """Number `number` in [0, 1) from the bits of a ray, the same on every machine."""
    x = np.uint32(bits[p, DX, lane] + np.uint32(number))
    x ^= np.uint32(bits[p, DY, lane]) * np.uint32(0x9E3779B1)
    x ^= np.uint32(bits[p, OX, lane]) * np.uint32(0x85EBCA77)
    x = np.uint32(x ^ (x >> np.uint32(15))) * np.uint32(0x2C1B3C6D)
    x = np.uint32(x ^ (x >> np.uint32(12))) * np.uint32(0x297A2D39)
    return R(np.uint32(x ^ (x >> np.uint32(15))) >> np.uint32(8)) * R(1.0 / (1 << 24))


@njit(**LEAN)
def thin_out(count, shadows, opacity, gaps, surfaces, triangles, epsilon, aovs, film):
    """Attenuate shadow rays at see-through surfaces, after `intersect`.

    A ray that hit nothing adds its light; a ray that hit an opaque surface ends; any other ray is
    attenuated and goes on behind the surface. Returns the number of rays that go on, which are
    packed to the front.

    opacity : (materials,) float32 - the constant of each material, negative if its opacity varies
        over the surface, BY_DIRECTION if it depends on the direction
    gaps : (materials, *TABLE) float32 - what passes the latter, by direction
    """
    rays, shadow, shadow_path = shadows
    records, triangle_material = triangles.records, triangles.material
    whole = rays.view(np.uint32)
    left = 0
    for k in range(count):
        p, lane = k >> 4, k & 15
        path = shadow_path[k]
        row = DIRECT if path >= 0 else INDIRECT
        column = path if path >= 0 else -path - 1
        if whole[p, GEOMETRY, lane] == MISS:
            for j in range(3):
                film[row + j, column] += shadow[j, k]
            if aovs and row == DIRECT:
                film[LIT, column] += shadow[0, k] + shadow[1, k] + shadow[2, k]
            continue
        triangle = whole[p, PRIMITIVE, lane]
        material = triangle_material[triangle]
        record = records[triangle]
        u, v = rays[p, HIT_U, lane], rays[p, HIT_V, lane]
        blocked = opacity[material]
        if blocked == R(BY_DIRECTION):
            blocked = R(1) - gap_along(
                gaps[material], record, u, v, rays[p, DX, lane], rays[p, DY, lane],
                rays[p, DZ, lane],
            )  # fmt: skip
        elif blocked < R(0):
            blocked = opacity_at(
                surfaces, material,
                record[ST] + u * record[D1] + v * record[D2],
                record[ST + 1] + u * record[D1 + 1] + v * record[D2 + 1],
            )  # fmt: skip
        through = R(1) - blocked
        if through < R(FAINT):
            if through <= R(1e-4) or _chance(whole, p, lane, 1) * R(FAINT) >= through:
                continue
            through = R(FAINT)
        rest = rays[p, TFAR, lane]
        q, place = left >> 4, left & 15
        end = shadow[3, k]
        for j in range(3):
            shadow[j, left] = through * shadow[j, k]
        shadow_path[left] = path
        dx, dy, dz = rays[p, DX, lane], rays[p, DY, lane], rays[p, DZ, lane]
        x = record[P0] + u * record[E1] + v * record[E2]
        y = record[P0 + 1] + u * record[E1 + 1] + v * record[E2 + 1]
        z = record[P0 + 2] + u * record[E1 + 2] + v * record[E2 + 2]
        rays[q, OX, place], rays[q, OY, place], rays[q, OZ, place] = x, y, z
        rays[q, DX, place], rays[q, DY, place], rays[q, DZ, place] = dx, dy, dz
        rays[q, TNEAR, place] = R(8) * epsilon + R(4e-6) * max(abs(x), max(abs(y), abs(z)))
        rays[q, TFAR, place] = end if end >= INFINITE_DISTANCE else end - rest
        shadow[3, left] = rays[q, TFAR, place]
        whole[q, GEOMETRY, place] = MISS
        left += 1
    _close(rays, left)
    return left

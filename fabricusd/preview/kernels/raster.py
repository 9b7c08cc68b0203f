"""Rasterise triangles, and find for each pixel the directions that the surface laws take."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.kernels.real import INLINE, KERNEL, LEAN

NOTHING = -1
"""Number of the triangle in a pixel that none covers."""


@njit(**LEAN)
def rasterise(corners, dx, dy, depth, triangle, weights):
    """Draw triangles into a depth buffer, keeping what is nearest.

    corners : (m, 3, 4) float64 - X, Y, W and Z: the corner is at the pixel coordinates X/W, Y/W,
        and Z is its distance. Triangles with a corner at W <= 0 are left out
    dx, dy : offset of the sample from the middle of each pixel [pixels]
    depth : (h, w) float64, filled with infinity; triangle : (h, w) int32, filled with NOTHING
    weights : (h, w, 2) float32 - barycentric coordinates of the second and the third corner

    A pixel's barycentric coordinates are those of the ray through it: with the corners as vectors
    (X, Y, W), they are proportional to triple products, and perspective needs no division.
    """
    h, w = depth.shape
    for m in range(corners.shape[0]):
        c = corners[m]
        if not (c[0, 2] > 0.0 and c[1, 2] > 0.0 and c[2, 2] > 0.0):
            continue
        x0, x1, x2 = c[0, 0] / c[0, 2], c[1, 0] / c[1, 2], c[2, 0] / c[2, 2]
        y0, y1, y2 = c[0, 1] / c[0, 2], c[1, 1] / c[1, 2], c[2, 1] / c[2, 2]
        left, right = min(x0, min(x1, x2)), max(x0, max(x1, x2))
        top, bottom = min(y0, min(y1, y2)), max(y0, max(y1, y2))
        i0 = int(max(0.0, math.ceil(min(left - 0.5 - dx, float(w)))))
        i1 = int(min(float(w - 1), math.floor(max(right - 0.5 - dx, -1.0))))
        j0 = int(max(0.0, math.ceil(min(top - 0.5 - dy, float(h)))))
        j1 = int(min(float(h - 1), math.floor(max(bottom - 0.5 - dy, -1.0))))
        ax = c[1, 1] * c[2, 2] - c[1, 2] * c[2, 1]
        ay = c[1, 2] * c[2, 0] - c[1, 0] * c[2, 2]
        az = c[1, 0] * c[2, 1] - c[1, 1] * c[2, 0]
        det = ax * c[0, 0] + ay * c[0, 1] + az * c[0, 2]
        if det == 0.0:
            continue
        bx = c[2, 1] * c[0, 2] - c[2, 2] * c[0, 1]
        by = c[2, 2] * c[0, 0] - c[2, 0] * c[0, 2]
        bz = c[2, 0] * c[0, 1] - c[2, 1] * c[0, 0]
        cx = c[0, 1] * c[1, 2] - c[0, 2] * c[1, 1]
        cy = c[0, 2] * c[1, 0] - c[0, 0] * c[1, 2]
        cz = c[0, 0] * c[1, 1] - c[0, 1] * c[1, 0]
        sign = 1.0 if det > 0.0 else -1.0
        for j in range(j0, j1 + 1):
            y = j + 0.5 + dy
            for i in range(i0, i1 + 1):
                x = i + 0.5 + dx
                a = sign * (ax * x + ay * y + az)
                b = sign * (bx * x + by * y + bz)
                d = sign * (cx * x + cy * y + cz)
                if a < 0.0 or b < 0.0 or d < 0.0:
                    continue
                whole = a + b + d
                if whole <= 0.0:
                    continue
                b, d = b / whole, d / whole
                z = c[0, 3] + b * (c[1, 3] - c[0, 3]) + d * (c[2, 3] - c[0, 3])
                if z < depth[j, i]:
                    depth[j, i], triangle[j, i] = z, m
                    weights[j, i, 0], weights[j, i, 1] = b, d


@njit(**KERNEL)
def frames(shape, eye, key, up, lift, pixels, triangle, weights, wo, wi, sky, uv, place):
    """The directions at covered pixels, in the surface frame of the cloth there.

    shape : (points, normals, tangents, hand, st) of `shapes.Shape`
    eye : (3,) place of the camera; key, up : (3,) unit vectors, to the light and to the zenith
    lift : distance above the surface at which `place` lies [m]
    pixels : (n,) int64 - indices of the covered pixels; triangle : (h w,), weights : (h w, 2)
    wo, wi, sky : (3, n) real - to the viewer, to the light, and the zenith
    uv : (n, 2) float64 - weave coordinates [threads]; place : (n, 3) real [m]
    """
    points, normals, tangents, hand, st = shape
    p, n, t, g = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    o = np.empty(3)
    for k in range(pixels.size):
        q = pixels[k]
        m = triangle[q]
        b, c = float(weights[q, 0]), float(weights[q, 1])
        a = 1.0 - b - c
        for x in range(3):
            p[x] = a * points[m, 0, x] + b * points[m, 1, x] + c * points[m, 2, x]
            n[x] = a * normals[m, 0, x] + b * normals[m, 1, x] + c * normals[m, 2, x]
            t[x] = a * tangents[m, 0, x] + b * tangents[m, 1, x] + c * tangents[m, 2, x]
            o[x] = eye[x] - p[x]
        for x in range(3):
            y, z = (x + 1) % 3, (x + 2) % 3
            g[x] = (points[m, 1, y] - points[m, 0, y]) * (points[m, 2, z] - points[m, 0, z]) - (
                points[m, 1, z] - points[m, 0, z]
            ) * (points[m, 2, y] - points[m, 0, y])
        _unit(o)
        _unit(g)
        _unit(n)
        side = 1.0 if _dot(g, o) >= 0.0 else -1.0
        # A smooth normal that faces away from the viewer, although the triangle does not.
        away = side * _dot(n, o) <= 1e-4
        for x in range(3):
            n[x] = side * (g[x] if away else n[x])
        d = _dot(t, n)
        for x in range(3):
            t[x] -= d * n[x]
        _unit(t)
        turn = hand[m]
        vx = turn * (n[1] * t[2] - n[2] * t[1])
        vy = turn * (n[2] * t[0] - n[0] * t[2])
        vz = turn * (n[0] * t[1] - n[1] * t[0])
        for way, out in ((o, wo), (key, wi), (up, sky)):
            out[0, k] = _dot(way, t)
            out[1, k] = way[0] * vx + way[1] * vy + way[2] * vz
            out[2, k] = _dot(way, n)
        for x in range(3):
            place[k, x] = p[x] + lift * n[x]
        for x in range(2):
            uv[k, x] = a * st[m, 0, x] + b * st[m, 1, x] + c * st[m, 2, x]


@njit(**INLINE)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(**INLINE)
def _unit(a):
    length = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    scale = 1.0 / max(length, 1e-30)
    a[0] *= scale
    a[1] *= scale
    a[2] *= scale


@njit(**LEAN)
def reached(depth, x, y, z, out):
    """(n,) share of the light that reaches places, by a map of the distances that it reaches.

    depth : (h, w) float64; x, y : (n,) places in it [pixels]; z : (n,) their distances
    The four texels around a place are compared and mixed, so that a shadow's edge is as wide as
    one.
    """
    h, w = depth.shape
    for k in range(out.size):
        i, j = math.floor(x[k] - 0.5), math.floor(y[k] - 0.5)
        a, b = x[k] - 0.5 - i, y[k] - 0.5 - j
        total = 0.0
        for r in range(2):
            for s in range(2):
                m, n = int(i) + s, int(j) + r
                inside = 0 <= m < w and 0 <= n < h
                lit = 1.0 if not inside or z[k] <= depth[n, m] else 0.0
                total += (a if s else 1.0 - a) * (b if r else 1.0 - b) * lit
        out[k] = total

"""Camera rays: a thin lens, a pixel filter, and the cone that a pixel subtends.

The filter is importance-sampled: each sample belongs to one pixel with weight 1. Pixels are
therefore independent of one another, and the variance of a pixel is the variance of a mean.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.kernels.real import INLINE, KERNEL, cos, exp, log, sin
from fabricusd.reference.rays.embree import (
    DX,
    DY,
    DZ,
    ENDLESS,
    GEOMETRY,
    INFINITE_DISTANCE,
    LANES,
    MISS,
    OX,
    OY,
    OZ,
    TFAR,
    TNEAR,
)
from fabricusd.reference.rays.sobol import four_numbers
from fabricusd.scene.scene import Camera, Scene

R = np.float32
FILTERS = ("box", "tent", "spline")
"""Radius half a pixel, one pixel (the default), one and a half pixels (quadratic B-spline)."""


class Lens(NamedTuple):
    """A camera for one picture size, in float32 and relative to the scene's centre.

    eye : (3,) - position; across, down : (3,) - steps of one pixel at distance 1; forward : (3,) -
        from the eye to pixel corner (0, 0) at distance 1
    right, up : (3,) - unit axes of the lens; axis : (3,) - unit viewing direction
    aperture_radius, focus : [m]; near, far : [m], along the viewing direction
    spread : angle of a pixel [rad]; for an orthographic camera the width of a pixel [m]
    """

    eye: NDArray[np.float32]
    across: NDArray[np.float32]
    down: NDArray[np.float32]
    forward: NDArray[np.float32]
    right: NDArray[np.float32]
    up: NDArray[np.float32]
    axis: NDArray[np.float32]
    aperture_radius: np.float32
    focus: np.float32
    near: np.float32
    far: np.float32
    spread: np.float32
    orthographic: bool
    filter: int


def build_lens(
    camera: Camera, width: int, height: int, centre: NDArray[np.float64], pixel_filter: str
) -> Lens:
    """The lens of `camera` for a picture of `width` by `height`; the aperture keeps its width.

    Raises FabricError for an unknown `pixel_filter`.
    """
    if pixel_filter not in FILTERS:
        raise FabricError(
            "pixel filter", f"is '{pixel_filter}'; it must be one of {', '.join(FILTERS)}"
        )
    right, up, back, eye = (camera.frame[:3, k] for k in range(4))
    wide = camera.aperture[0]
    scale = 1.0 if camera.orthographic else 1.0 / camera.focal_length
    pixel = wide * scale / width
    offset = np.array(camera.aperture_offset) * scale
    across, down = right * pixel, -up * pixel
    corner = right * (offset[0] - 0.5 * wide * scale) + up * (offset[1] + 0.5 * pixel * height)
    if not camera.orthographic:
        corner = corner - back
    radius = 0.0
    if camera.f_stop > 0 and camera.focus_distance > 0 and not camera.orthographic:
        radius = 0.5 * camera.focal_length / camera.f_stop

    def real(v: NDArray[np.float64]) -> NDArray[np.float32]:
        return np.ascontiguousarray(v, np.float32)

    return Lens(
        real(eye - centre), real(across), real(down), real(corner), real(right), real(up),
        real(-back), R(radius), R(camera.focus_distance or 1.0), R(camera.clipping[0]),
        R(min(camera.clipping[1], float(INFINITE_DISTANCE))), R(pixel), camera.orthographic,
        FILTERS.index(pixel_filter),
    )  # fmt: skip


@njit(**INLINE)
def _nearer(x, u):
    """One step of Newton's method for the place where the spline's integral (middle part) is u."""
    return x - (x * (R(0.75) - x * x * R(1 / 3)) - (u - R(0.5))) / (R(0.75) - x * x)


@njit(**INLINE)
def filter_offset(kind, u):
    """Offset [pixels] from the filter's centre: the inverse of the filter's integral at u."""
    upper = u >= R(0.5)
    half = R(1) - u if upper else u
    tent = math.sqrt(R(2) * half) - R(1)
    # The integral of the spline's tail is a cube. Its middle part, x (3/4 - x^2/3) = half - 1/2, is
    # inverted by three Newton steps that start from the line that joins its ends.
    tail = exp(R, log(R, max(R(6) * half, R(1e-30))) * R(1 / 3)) - R(1.5)
    x = R(1.5) * (half - R(0.5))
    x = _nearer(_nearer(_nearer(x, half), half), half)
    spline = tail if half < R(1 / 6) else x
    place = u - R(0.5)
    smooth = tent if kind == 1 else spline
    smooth = -smooth if upper else smooth
    return place if kind == 0 else smooth


# Rows of the inputs of a packet of camera rays: column and row of the pixel, and the spread of the
# ray's cone.
_COLUMN, _ROW, _SPREAD = (row * LANES for row in range(3))


@njit(**KERNEL)
def camera_rays(lens, width, pixels, first, samples, numbers, packets, cone, paths):
    """Write the camera rays of `samples` samples for each of `pixels`, starting at sample `first`.

    pixels : (n,) int32 - row times `width` plus column; path `k` is sample `k % samples` of pixel
        number `k // samples` in this array
    packets : (packets, ROWS 16) float32; cone : (2, n samples) - width and spread of each ray
    paths : `Paths` of n samples entries
    """
    path_pixel, path_sample = paths.pixel, paths.sample
    count = pixels.shape[0] * samples
    places = np.empty(3 * LANES, np.float32)
    counters = np.empty(2 * LANES, np.uint32)
    pixel, sample = 0, 0
    for p in range((count + LANES - 1) // LANES):
        start = p * LANES
        size = min(LANES, count - start)
        for lane in range(size):
            number = pixels[pixel]
            counters[lane], counters[LANES + lane] = np.uint32(number), np.uint32(first + sample)
            path_pixel[start + lane] = counters[lane]
            path_sample[start + lane] = counters[LANES + lane]
            row = number // width
            places[_COLUMN + lane], places[_ROW + lane] = R(number - row * width), R(row)
            sample += 1
            if sample == samples:
                pixel, sample = pixel + 1, 0
        _packet(lens, numbers, size, counters, places, packets[p])
        whole = packets[p].view(np.uint32)
        for lane in range(size):
            whole[GEOMETRY * LANES + lane] = MISS
            cone[0, start + lane] = lens.spread if lens.orthographic else R(0)
            cone[1, start + lane] = places[_SPREAD + lane]
        for lane in range(size, LANES):
            packets[p, TNEAR * LANES + lane], packets[p, TFAR * LANES + lane] = R(0), R(-1)


@njit(**INLINE)
def _packet(lens, numbers, size, counters, places, packet):
    """Write one packet of rays. All inputs are read before the loop, so that LLVM vectorises it."""
    flat = R(0) if lens.orthographic else R(1)
    round_ = R(1) - flat
    radius, focus, spread, kind = lens.aperture_radius, lens.focus, lens.spread, lens.filter
    near, far = lens.near, lens.far
    fx, fy, fz = lens.forward[0], lens.forward[1], lens.forward[2]
    cx, cy, cz = lens.across[0], lens.across[1], lens.across[2]
    hx, hy, hz = lens.down[0], lens.down[1], lens.down[2]
    rx, ry, rz = lens.right[0], lens.right[1], lens.right[2]
    vx, vy, vz = lens.up[0], lens.up[1], lens.up[2]
    zx, zy, zz = lens.axis[0], lens.axis[1], lens.axis[2]
    ex, ey, ez = lens.eye[0], lens.eye[1], lens.eye[2]
    for lane in range(size):
        u0, u1, u2, u3 = four_numbers(numbers, counters[lane], counters[LANES + lane], np.uint32(0))
        x = places[_COLUMN + lane] + R(0.5) + filter_offset(kind, u0)
        y = places[_ROW + lane] + R(0.5) + filter_offset(kind, u1)
        ax, ay = fx + x * cx + y * hx, fy + x * cy + y * hy
        az = fz + x * cz + y * hz
        # The point on the lens. The radius is 0 for a pinhole and for an orthographic camera.
        r, phi = radius * math.sqrt(u2), R(2 * math.pi) * u3
        a, b = r * cos(R, phi), r * sin(R, phi)
        sx, sy = a * rx + b * vx + round_ * ax, a * ry + b * vy + round_ * ay
        sz = a * rz + b * vz + round_ * az
        ax, ay = flat * (ax * focus - sx) + round_ * zx, flat * (ay * focus - sy) + round_ * zy
        az = flat * (az * focus - sz) + round_ * zz
        inverse = R(1) / math.sqrt(ax * ax + ay * ay + az * az)
        ax, ay, az = ax * inverse, ay * inverse, az * inverse
        packet[OX * LANES + lane], packet[OY * LANES + lane] = ex + sx, ey + sy
        packet[OZ * LANES + lane] = ez + sz
        packet[DX * LANES + lane], packet[DY * LANES + lane] = ax, ay
        packet[DZ * LANES + lane] = az
        cosine = max(ax * zx + ay * zy + az * zz, R(1e-3))
        packet[TNEAR * LANES + lane] = near / cosine
        packet[TFAR * LANES + lane] = far / cosine if far < ENDLESS else INFINITE_DISTANCE
        places[_SPREAD + lane] = flat * spread * cosine


def default_camera(scene: Scene, width: int, height: int) -> Camera:
    """A 50 mm camera that sees the whole scene from the front, slightly from above and the side."""
    low, high = scene.bounds()
    centre, radius = 0.5 * (low + high), max(float(np.linalg.norm(high - low)) / 2, 1e-6)
    up = np.array([0.0, 0.0, 1.0]) if scene.up_axis == "Z" else np.array([0.0, 1.0, 0.0])
    front = np.array([0.0, -1.0, 0.0]) if scene.up_axis == "Z" else np.array([0.0, 0.0, 1.0])
    side = np.cross(up, front)
    back = front + 0.45 * side + 0.4 * up
    back = back / np.linalg.norm(back)
    right = np.cross(up, back)
    right = right / np.linalg.norm(right)
    frame = np.eye(4)
    frame[:3, 0], frame[:3, 1], frame[:3, 2] = right, np.cross(back, right), back
    half = math.atan(0.018 / 0.05 * min(1.0, height / width))
    frame[:3, 3] = centre + back * radius / math.sin(half) * 1.02
    return Camera(path="default camera", frame=frame)

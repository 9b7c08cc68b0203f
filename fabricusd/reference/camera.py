"""Camera rays: a thin lens, a pixel filter, and the cone that a pixel is.

The filter is importance-sampled: each sample belongs to one pixel and has the weight 1, so pixels
are independent of one another and their variance is the variance of the mean.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.real import INLINE, LEAN, cos, sin
from fabricusd.errors import FabricError
from fabricusd.reference.embree import DX, DY, DZ, GEOMETRY, MISS, OX, OY, OZ, TFAR, TNEAR
from fabricusd.reference.scene import Camera, Scene
from fabricusd.reference.sobol import four_numbers

R = np.float32
FILTERS = ("box", "tent", "spline")
"""Half a pixel wide, one pixel (the default), one and a half (quadratic B-spline)."""

FAR = R(1e30)
"""Length of a ray without end."""


class Lens(NamedTuple):
    """A camera for one picture size, in float32 around the scene's centre.

    eye, across, down, forward : (3,) - position; steps of one pixel at distance 1; towards pixel
        corner (0, 0) at distance 1
    right, up : (3,) - unit axes of the lens; axis : (3,) - unit viewing direction
    aperture_radius, focus : [m]; near, far : [m], along the viewing direction
    spread : angle of a pixel [rad]; pixel : width of a pixel [m], 0 unless orthographic
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
    """The lens of `camera` for a picture of `width` by `height`, the aperture's width kept."""
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
        R(min(camera.clipping[1], 1e30)), R(pixel), camera.orthographic,
        FILTERS.index(pixel_filter),
    )  # fmt: skip


@njit(**INLINE)
def _filter_offset(kind, u, v):
    """Place in a pixel's filter, its centre at 0."""
    if kind == 0:
        return u - R(0.5)
    tent = math.sqrt(R(2) * u) - R(1) if u < R(0.5) else R(1) - math.sqrt(R(2) - R(2) * u)
    if kind == 1:
        return tent
    return tent + v - R(0.5)


@njit(**LEAN)
def camera_rays(lens, width, pixels, first, samples, numbers, rays, cone, path_pixel, path_sample):
    """Write the rays of `samples` samples of each of `pixels`, from sample `first` on.

    pixels : (n,) int32 - row times `width` plus column; path `k` is sample `k % samples` of pixel
    `k // samples`. rays : packets; cone : (2, n samples) - width and spread of each ray.
    path_pixel, path_sample : (n samples,) uint32 - the counters of each path's random numbers.
    """
    whole = rays.view(np.uint32)
    count = pixels.shape[0] * samples
    for k in range(count):
        p, lane = k >> 4, k & 15
        pixel = pixels[k // samples]
        sample = np.uint32(first + k % samples)
        path_pixel[k], path_sample[k] = np.uint32(pixel), sample
        u0, u1, u2, u3 = four_numbers(numbers, np.uint32(pixel), sample, np.uint32(0))
        v0, v1 = R(0.5), R(0.5)
        if lens.filter == 2:
            v0, v1, _, _ = four_numbers(numbers, np.uint32(pixel), sample, np.uint32(1))
        x = R(pixel % width) + R(0.5) + _filter_offset(lens.filter, u0, v0)
        y = R(pixel // width) + R(0.5) + _filter_offset(lens.filter, u1, v1)
        ax = lens.forward[0] + x * lens.across[0] + y * lens.down[0]
        ay = lens.forward[1] + x * lens.across[1] + y * lens.down[1]
        az = lens.forward[2] + x * lens.across[2] + y * lens.down[2]
        ox, oy, oz = lens.eye[0], lens.eye[1], lens.eye[2]
        if lens.orthographic:
            ox, oy, oz = ox + ax, oy + ay, oz + az
            ax, ay, az = lens.axis[0], lens.axis[1], lens.axis[2]
        elif lens.aperture_radius > R(0):
            r, phi = lens.aperture_radius * math.sqrt(u2), R(2 * math.pi) * u3
            a, b = r * cos(R, phi), r * sin(R, phi)
            sx = a * lens.right[0] + b * lens.up[0]
            sy = a * lens.right[1] + b * lens.up[1]
            sz = a * lens.right[2] + b * lens.up[2]
            ox, oy, oz = ox + sx, oy + sy, oz + sz
            ax, ay, az = ax * lens.focus - sx, ay * lens.focus - sy, az * lens.focus - sz
        inverse = R(1) / math.sqrt(ax * ax + ay * ay + az * az)
        ax, ay, az = ax * inverse, ay * inverse, az * inverse
        rays[p, OX, lane], rays[p, OY, lane], rays[p, OZ, lane] = ox, oy, oz
        rays[p, DX, lane], rays[p, DY, lane], rays[p, DZ, lane] = ax, ay, az
        cosine = max(ax * lens.axis[0] + ay * lens.axis[1] + az * lens.axis[2], R(1e-3))
        rays[p, TNEAR, lane] = lens.near / cosine
        rays[p, TFAR, lane] = lens.far / cosine if lens.far < R(1e29) else FAR
        whole[p, GEOMETRY, lane] = MISS
        cone[0, k] = lens.spread if lens.orthographic else R(0)
        cone[1, k] = R(0) if lens.orthographic else lens.spread * cosine
    for k in range(count, ((count + 15) >> 4) << 4):
        rays[k >> 4, TNEAR, k & 15] = R(0)
        rays[k >> 4, TFAR, k & 15] = R(-1)


def default_camera(scene: Scene, width: int, height: int) -> Camera:
    """A 50 mm camera that sees the whole scene from the front, a little from above and the side."""
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

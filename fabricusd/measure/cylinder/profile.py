"""The light of wraps in a photograph, against where on the cylinder it is from."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.signal import detrend

from fabricusd.errors import FabricError
from fabricusd.images.files import read_image
from fabricusd.measure.cylinder.setup import Cylinder, Stand, frame_at

Floats = NDArray[np.float64]

EDGE = 0.93
"""Largest distance from the axis, in radii, that is used: beyond, a pixel covers too much cloth."""
LOWEST_LIGHT, LOWEST_VIEW = 0.12, 0.43
"""Least cosines to the normal of light and camera. At lower views, shot silk would be brighter than
white, which the law keeps it from and the fit does not."""
PLACES = 110
"""Places across a wrap."""
FEWEST_LINES, MOST_LINES = 24, 512
"""Lines along a wrap that are averaged, between these one for each pixel of its height."""
PIXEL = 1 / 3
"""Variance of what blurs a photograph [squared pixels]: a pixel's own filter, and the interpolation
between pixels. Without it, narrow lobes come out too wide."""
RELATIVE, FLOOR = 0.01, 0.003
"""What a model of cloth may be off by: a share of the light, and of the brightest light."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """A wrap in a photograph.

    wi, wo : (2, n, 3) in the cloth's frame, at two heights whose mean is that of all lines
    light, sigma : (n, 3)
    side : (n,) distance from the axis to the right, in radii
    blur : half the variance of a pixel's filter, in squared distances of two places
    """

    cylinder: Cylinder
    photograph: int
    wi: Floats
    wo: Floats
    light: Floats
    sigma: Floats
    side: Floats
    blur: float = 0.0

    def seen(self, light: Floats) -> Floats:
        """(n, ...) what pixels show of light (2, n, ...) at the places, to second order."""
        light = light.mean(axis=0)
        ends = np.concatenate((light[:1], light, light[-1:]))
        return np.asarray(light + self.blur * (ends[2:] - 2.0 * light + ends[:-2]))


def read_profiles(paths: list[str], stand: Stand) -> list[Profile]:
    """The wraps of all photographs; FabricError where one cannot be read or shows no cloth."""
    found = []
    for k, path in enumerate(paths):
        picture = np.asarray(read_image(path), np.float64)
        if picture.shape[2] == 1:
            picture = np.repeat(picture, 3, axis=2)
        bad = int(np.count_nonzero(~np.isfinite(picture)))
        if bad:
            raise FabricError(f"'{path}'", f"has {bad} values that are not finite; all must be")
        if picture.max() <= 0:
            raise FabricError(f"'{path}'", "is black; it must show lit cloth")
        for cylinder in stand.cylinders:
            found.append(profile(picture, stand, cylinder, k, path))
    return found


def profile(
    picture: Floats, stand: Stand, cylinder: Cylinder, photograph: int, path: str
) -> Profile:
    """One wrap of one photograph.

    Each place across is the mean over lines along the cylinder, whose spread tells the noise.
    """
    eye, light = np.asarray(stand.eye), np.asarray(stand.lights[photograph])
    towards = math.atan2(eye[0] - cylinder.x, eye[2] - cylinder.z)
    s = np.linspace(-EDGE, EDGE, PLACES)
    phi = towards + np.arcsin(s)
    u, v, normal = frame_at(cylinder, phi)
    middle = 0.5 * (cylinder.bottom + cylinder.top)
    base = np.array([cylinder.x, middle, cylinder.z]) + cylinder.radius * normal
    ends = base[[PLACES // 2] * 2] + np.outer(
        [cylinder.bottom - middle, cylinder.top - middle], [0.0, 1.0, 0.0]
    )
    tall = float(np.linalg.norm(np.diff(stand.project(ends, picture.shape[:2]), axis=0)))
    lines = int(np.clip(round(tall), FEWEST_LINES, MOST_LINES))
    heights = np.linspace(cylinder.bottom, cylinder.top, lines) - middle
    at = base[None] + heights[:, None, None] * np.array([0.0, 1.0, 0.0])
    axes = np.stack((u, v, normal), axis=1)
    # Gauss's two points, as exact as a cubic along the lines.
    two = np.array([-1.0, 1.0]) / math.sqrt(3.0) * 0.5 * (cylinder.top - cylinder.bottom)
    to_eye = eye - base - two[:, None, None] * np.array([0.0, 1.0, 0.0])
    to_eye /= np.linalg.norm(to_eye, axis=-1)[..., None]
    wi = np.stack([axes @ light] * 2)
    wo = np.einsum("nij,hnj->hni", axes, to_eye)
    pixels = stand.project(at.reshape(-1, 3), picture.shape[:2])
    h, w = picture.shape[:2]
    if pixels.min() < 0.5 or pixels[:, 0].max() > w - 0.5 or pixels[:, 1].max() > h - 0.5:
        raise FabricError(
            f"'{path}'", f"does not show all of '{cylinder.name}': is it the setup's?"
        )
    across = float(np.ptp(pixels[:, 0])) / (PLACES - 1)
    rows = np.stack([
        map_coordinates(picture[..., c], [pixels[:, 1] - 0.5, pixels[:, 0] - 0.5], order=1)
        for c in range(3)
    ], axis=1).reshape(lines, PLACES, 3)  # fmt: skip
    mean = rows.mean(axis=0)
    # Light that changes along the cylinder is no noise, and the spread of few lines is itself
    # noisy: smoothed along the wrap it is not.
    noise = detrend(rows, axis=0).std(axis=0) / math.sqrt(lines)
    kernel = np.ones(9) / 9
    noise = np.stack(
        [np.convolve(np.pad(noise[:, c], 4, "edge"), kernel, "valid") for c in range(3)], axis=1
    )
    sigma = np.sqrt(noise**2 + (RELATIVE * mean) ** 2 + (FLOOR * mean.max()) ** 2)
    good = ((wi[..., 2] > LOWEST_LIGHT) & (wo[..., 2] > LOWEST_VIEW)).all(axis=0)
    if np.count_nonzero(good) < 12:
        raise FabricError(f"'{path}'", f"shows '{cylinder.name}' unlit: is the light the setup's?")
    return Profile(
        cylinder=cylinder, photograph=photograph, wi=wi[:, good], wo=wo[:, good], light=mean[good],
        sigma=sigma[good], side=s[good], blur=0.5 * PIXEL / across**2,
    )  # fmt: skip

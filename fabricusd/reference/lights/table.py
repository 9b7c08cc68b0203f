"""Builds the table of lights and the chances of choosing each; `sampling` and `hits` read it.

Lights do not block rays: a ray goes on behind a light, so it sees the sum of all lights that it
passes before its first triangle. Sampling lights and hitting them therefore estimate the same
integral. Every `pdf` is per solid angle and includes the chance of choosing the light.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import LEAN, cos, sin
from fabricusd.reference.lights.dome import Dome, build_dome, place_of, smooth_radiance
from fabricusd.reference.lights.kinds import KINDS
from fabricusd.reference.lights.row import CHANCE, COLUMNS, KIND, RED, VISIBLE, P, axes_of
from fabricusd.scene.light_kinds import DOME
from fabricusd.scene.scene import Light

R = np.float32
_PI = R(math.pi)


class Lights(NamedTuple):
    """All lights of a scene: table : (n, COLUMNS) float32; dome : the picture of all domes."""

    table: NDArray[np.float32]
    dome: Dome


def build_lights(lights: list[Light], centre: NDArray[np.float64]) -> Lights:
    """Build the table of the lights, and the picture of all domes together.

    All lights get the same chance; `share_out` changes the chances.
    """
    table = np.zeros((0, COLUMNS), np.float32)
    rows = [_row(light, centre) for light in lights if light.kind != DOME]
    domes = [light for light in lights if light.kind == DOME]
    dome = _merge_domes(domes)
    if domes:
        # One row stands for all domes: their pictures are merged.
        hidden = all(light.hidden for light in domes)
        merged = Light(path="", kind=DOME, radiance=(0.0, 0.0, 0.0), hidden=hidden)
        rows.append(_row(merged, centre))
    if rows:
        table = np.ascontiguousarray(rows, np.float32)
        table[:, CHANCE] = 1 / len(rows)
    return Lights(table, dome)


def share_out(lights: Lights, places: NDArray[np.float32]) -> None:
    """Make the chance of choosing a light proportional to how brightly it lights `places`.

    places : (n, 3) [m], relative to the scene's centre - for example, what the camera sees
    """
    if not len(places):
        return
    table, dome = lights
    power = np.array([KINDS[int(row[KIND])].irradiance(row, dome, places) for row in table])
    if power.sum() > 0:
        # Keep a chance for every light: the estimate ignores shadows and the surfaces' orientation.
        table[:, CHANCE] = 0.8 * power / power.sum() + 0.2 / len(table)


def _row(light: Light, centre: NDArray[np.float64]) -> NDArray[np.float64]:
    row = np.zeros(COLUMNS)
    row[KIND], row[RED : RED + 3] = light.kind, light.radiance
    row[P : P + 3] = light.frame[:3, 3] - centre
    row[VISIBLE] = float(light.camera_visible)
    KINDS[light.kind].fill(row, light, axes_of(light))
    return row


def _merge_domes(domes: list[Light]) -> Dome:
    """Merge the pictures of all domes; a single picture is kept as it is."""
    if not domes:
        return build_dome(np.zeros((1, 1, 3)), np.eye(3))
    pictures = []
    for light in domes:
        image = np.ones((1, 1, 3), np.float32) if light.image is None else light.image
        pictures.append(np.asarray(image, np.float32) * np.array(light.radiance, np.float32))
    turns = [_rotation(light.frame) for light in domes]
    if len(domes) == 1:
        return build_dome(pictures[0], turns[0])
    h = max(p.shape[0] for p in pictures)
    w = max(p.shape[1] for p in pictures)
    total = np.zeros((h, w, 3), np.float32)
    for picture, turn in zip(pictures, turns, strict=True):
        _add_dome(total, build_dome(picture, turn))
    return build_dome(total, np.eye(3))


@njit(**LEAN)
def _add_dome(total, dome):
    h, w = total.shape[0], total.shape[1]
    for j in range(h):
        for i in range(w):
            theta = (R(j) + R(0.5)) * (_PI / R(h))
            longitude = (R(i) + R(0.5)) * (R(2) * _PI / R(w)) - R(0.5) * _PI
            sine = sin(R, theta)
            x, y, z = sine * cos(R, longitude), cos(R, theta), sine * sin(R, longitude)
            column, row = place_of(dome, x, y, z)
            red, green, blue = smooth_radiance(dome, column, row)
            total[j, i, 0] += red
            total[j, i, 1] += green
            total[j, i, 2] += blue


def _rotation(frame: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rotation from world to local space, from the frame's axes made orthonormal."""
    x = frame[:3, 0] / max(float(np.linalg.norm(frame[:3, 0])), 1e-30)
    y = frame[:3, 1] - x * (x @ frame[:3, 1])
    y = y / max(float(np.linalg.norm(y)), 1e-30)
    z = np.cross(x, y)
    return np.stack([x, y, z * np.sign(z @ frame[:3, 2] or 1.0)])

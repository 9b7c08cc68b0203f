"""Lights as rows of one table: chosen by power. `light_sampling` draws from them, `light_hits` is
what rays meet.

Lights are no obstacles: a ray goes on behind them, so what a ray sees is the sum over all that it
passes before its first triangle. That keeps sampling and hitting two estimators of one integral.
Each `pdf` is per solid angle and holds the chance of choosing the light.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import LEAN, cos, sin
from fabricusd.reference.lights.dome import LUMINANCE, Dome, build_dome, place_of, smooth_radiance
from fabricusd.scene.scene import CYLINDER, DISK, DISTANT, DOME, RECT, SPHERE, Light

R = np.float32
_PI = R(math.pi)

# Columns of the table. X and Y are half the extent of a rect, the radii of a disk, X half the axis
# of a cylinder; Z is the unit direction it shines to, for a distant light the one it comes from.
KIND, CHANCE, RED, P, X, Y, Z, SIZE, AREA, VISIBLE = 0, 1, 2, 5, 8, 11, 14, 17, 18, 19
COLUMNS = 20


def build_lights(
    lights: list[Light], centre: NDArray[np.float64]
) -> tuple[NDArray[np.float32], Dome]:
    """The table (n, COLUMNS) float32 and the dome's picture, all domes added into one.

    `share_out` gives the lights other chances than equal ones.
    """
    table = np.zeros((0, COLUMNS), np.float32)
    rows = [_row(light, centre) for light in lights if light.kind != DOME]
    domes = [light for light in lights if light.kind == DOME]
    dome = _merge_domes(domes)
    if domes:
        row = np.zeros(COLUMNS)
        row[KIND] = DOME
        row[VISIBLE] = 1.0
        rows.append(row)
    if rows:
        table = np.ascontiguousarray(rows, np.float32)
        table[:, CHANCE] = 1 / len(rows)
    return table, dome


def share_out(table: NDArray[np.float32], dome: Dome, places: NDArray[np.float32]) -> None:
    """Make the chance of choosing a light proportional to how brightly it lights `places`.

    places : (n, 3) [m] around the scene's centre - what the camera sees, say
    """
    if not len(places):
        return
    power = np.array([_irradiance(row, dome, places) for row in table])
    if power.sum() > 0:
        # No light is forgotten altogether: shadows and surfaces' directions are not known.
        table[:, CHANCE] = 0.8 * power / power.sum() + 0.2 / len(table)


def _row(light: Light, centre: NDArray[np.float64]) -> NDArray[np.float64]:
    row = np.zeros(COLUMNS)
    axes, position = light.frame[:3, :3], light.frame[:3, 3] - centre
    lengths = np.maximum(np.linalg.norm(axes, axis=0), 1e-30)
    row[KIND], row[RED : RED + 3], row[P : P + 3] = light.kind, light.radiance, position
    row[VISIBLE] = float(light.camera_visible)
    x, y = axes[:, 0], axes[:, 1]
    # Square to the surface, also where the frame is sheared or flat.
    normal = np.cross(x, y)
    z = (
        -normal
        * math.copysign(1.0, normal @ axes[:, 2])
        / max(float(np.linalg.norm(normal)), 1e-30)
    )
    if light.kind == DISTANT:
        z = axes[:, 2] / lengths[2]
        x, y = x / lengths[0], y / lengths[1]
        row[SIZE] = math.cos(0.5 * light.angle)
        # 1 - cos without cancellation, for the solid angle.
        row[AREA] = 2 * math.sin(0.25 * light.angle) ** 2
    elif light.kind == RECT:
        x, y = 0.5 * light.width * x, 0.5 * light.height * y
        row[AREA] = 4 * np.linalg.norm(np.cross(x, y))
    elif light.kind == DISK:
        x, y = light.radius * x, light.radius * y
        row[AREA] = math.pi * np.linalg.norm(np.cross(x, y))
    elif light.kind == SPHERE:
        row[SIZE] = light.radius * float(np.mean(lengths))
        row[AREA] = 4 * math.pi * row[SIZE] ** 2
    elif light.kind == CYLINDER:
        row[SIZE] = light.radius * float(np.mean(lengths[1:]))
        x, y, z = 0.5 * light.height * x, y / lengths[1], axes[:, 2] / lengths[2]
        row[AREA] = 2 * math.pi * row[SIZE] * light.height * lengths[0]
    row[X : X + 3], row[Y : Y + 3], row[Z : Z + 3] = x, y, z
    return row


def _irradiance(row: NDArray[np.float32], dome: Dome, places: NDArray[np.float32]) -> float:
    """Mean irradiance of surfaces at `places` that face any way that the light reaches."""
    if row[KIND] == DOME:
        h, w = (int(n) for n in dome.size)
        edges = np.cos(np.pi * np.arange(h + 1) / h)
        solid = np.repeat((edges[:-1] - edges[1:]) * 2 * np.pi / w, w)
        return float((dome.cells[:, :3] @ LUMINANCE) @ solid / 4)
    brightness = float(row[RED : RED + 3] @ LUMINANCE) / 2
    if row[KIND] == DISTANT:
        return brightness * (2 * math.pi * row[AREA] if row[AREA] > 0 else 1.0)
    away = np.asarray(places, np.float64) - row[P : P + 3]
    # Nearer than its size a light is no brighter.
    distance2 = np.maximum(np.einsum("ij,ij->i", away, away), max(float(row[AREA]), 1e-12))
    # The share of its surface that is seen, foreshortened.
    seen = np.full(len(away), 0.25)
    if row[KIND] not in (SPHERE, CYLINDER):
        seen = np.maximum(away @ row[Z : Z + 3], 0.0) / np.sqrt(distance2)
    return brightness * float(row[AREA]) * float((seen / distance2).mean())


def _merge_domes(domes: list[Light]) -> Dome:
    """One picture of all domes; kept as it is where there is only one."""
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
    """World to local, from the frame's axes made orthonormal."""
    x = frame[:3, 0] / max(float(np.linalg.norm(frame[:3, 0])), 1e-30)
    y = frame[:3, 1] - x * (x @ frame[:3, 1])
    y = y / max(float(np.linalg.norm(y)), 1e-30)
    z = np.cross(x, y)
    return np.stack([x, y, z * np.sign(z @ frame[:3, 2] or 1.0)])

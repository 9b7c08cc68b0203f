"""A studio for garments: a backdrop, a soft sky, a key light, a rim light, and a camera.

All of it is described relative to the subject's bounding box and its up axis, so that a button and
a curtain are lit alike: distances and lights grow with the subject, and radiances stay.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.scene.light_kinds import DOME, RECT
from fabricusd.scene.scene import Camera, Light

Vector = NDArray[np.float64]

GREY = (0.32, 0.31, 0.30)
"""Colour of the backdrop, linear Rec. 709: darker than most cloth, so that edges show."""

ROUGHNESS = 0.9

SKY = (0.51, 0.53, 0.55)
"""Radiance of the sky [W/m2/sr]."""

LAMPS = (
    # name, place in radii of the subject (right, up, front), side in radii, radiance
    ("Key", (-2.7, 4.0, 3.0), 1.7, (36.5, 33.3, 29.0)),
    ("Rim", (3.2, 3.2, -2.5), 1.3, (26.0, 26.2, 27.6)),
)

VIEW = (0.45, 0.25, 1.0)
"""From the subject to the camera: right, up, front."""

FOCAL_LENGTH, WIDE = 0.05, 0.036
"""Of the camera [m]: a 50 mm lens on full frame."""

ASPECT = 16 / 9
"""Width over height of a picture, where it is not told: that of `render`."""

MARGIN = 1.08
"""Size of the picture over that of the subject in it."""

SMALLEST = 1e-4
"""Radius [m] that a smaller subject, or none, is taken to have."""


@dataclass(frozen=True, kw_only=True)
class Subject:
    """What the studio stands around.

    low, high : (3,) float - corners of its bounding box [m]
    up_axis : "Y" or "Z"
    """

    low: Vector
    high: Vector
    up_axis: str = "Y"

    @property
    def centre(self) -> Vector:
        """(3,) middle of the bounding box [m]."""
        return np.asarray(0.5 * (self.low + self.high))

    @property
    def radius(self) -> float:
        """Half the diagonal of the bounding box [m]."""
        return max(float(np.linalg.norm(self.high - self.low)) / 2, SMALLEST)

    @property
    def axes(self) -> Vector:
        """(3, 3), columns right, up and front of the world."""
        if self.up_axis == "Z":
            return np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
        return np.eye(3)

    def place(self, right: float, up: float, front: float) -> Vector:
        """(3,) place [m] at these distances, in radii, from the middle."""
        return np.asarray(self.centre + self.axes @ np.array([right, up, front]) * self.radius)


def looking(eye: Vector, at: Vector, up: Vector) -> Vector:
    """(4, 4) frame at `eye` whose -z points to `at`, with +y as near to `up` as can be."""
    back = eye - at
    length = float(np.linalg.norm(back))
    back = back / length if length > 0 else np.array([0.0, 0.0, 1.0])
    right = np.cross(up, back)
    if np.linalg.norm(right) < 1e-6:
        # Seen from straight above or below, any direction may be right.
        right = np.cross(np.roll(up, 1), back)
    right = right / np.linalg.norm(right)
    frame = np.eye(4)
    frame[:3, 0], frame[:3, 1], frame[:3, 2] = right, np.cross(back, right), back
    frame[:3, 3] = eye
    return frame


def studio_lights(subject: Subject) -> list[Light]:
    """The sky, the key light from the left, and the rim light from behind."""
    lights = [Light(path="studio sky", kind=DOME, radiance=SKY, camera_visible=True)]
    for name, place, side, radiance in LAMPS:
        frame = looking(subject.place(*place), subject.centre, subject.axes[:, 1])
        size = side * subject.radius
        lights.append(
            Light(
                path=f"studio {name.lower()} light",
                kind=RECT,
                radiance=radiance,
                frame=frame,
                width=size,
                height=size,
            )
        )
    return lights


def backdrop(subject: Subject) -> tuple[Vector, NDArray[np.int32]]:
    """(points (n, 3) [m], quads (m, 4)) of a floor that bends up into a wall behind the subject.

    The floor lies at the subject's lowest point.
    """
    turn = np.linspace(0.0, math.pi / 2, 25)
    front = np.concatenate(([14.0], -3.0 - 2.5 * np.sin(turn), [-5.5]))
    up = np.concatenate(([0.0], 2.5 * (1.0 - np.cos(turn)), [16.0]))
    floor = float(((subject.low - subject.centre) @ subject.axes[:, 1]) / subject.radius)
    edges = [
        [subject.place(side, floor + y, z) for y, z in zip(up, front, strict=True)]
        for side in (-16.0, 16.0)
    ]
    points = np.array(edges).reshape(-1, 3)
    count = len(up)
    left = np.arange(count - 1, dtype=np.int32)
    quads = np.stack((left, left + count, left + count + 1, left + 1), axis=1)
    return points, quads


def framing(subject: Subject, towards: Vector, aspect: float = ASPECT) -> Camera:
    """A camera that sees the whole subject, from as near as can be.

    towards : (3,) from the subject to the camera, of any length; aspect : see ASPECT
    """
    frame = looking(towards + subject.centre, subject.centre, subject.axes[:, 1])
    aperture = (WIDE, WIDE / aspect)
    boxes = np.stack((subject.low, subject.high))
    grid = np.stack(np.meshgrid((0, 1), (0, 1), (0, 1)), axis=-1).reshape(-1, 3)
    corners = boxes[grid, np.arange(3)] - subject.centre
    x, y, z = (corners @ frame[:3, k] for k in range(3))
    slopes = [side / (2 * FOCAL_LENGTH) / MARGIN for side in aperture]
    distance = float(np.max(z + np.maximum(np.abs(x) / slopes[0], np.abs(y) / slopes[1])))
    distance = max(distance, SMALLEST)
    frame[:3, 3] = subject.centre + frame[:3, 2] * distance
    return Camera(
        path="studio camera",
        frame=frame,
        focal_length=FOCAL_LENGTH,
        aperture=aperture,
        focus_distance=distance,
    )


def studio_camera(subject: Subject, aspect: float = ASPECT, *, turn: float = 0.0) -> Camera:
    """A camera that sees the whole subject from the front, a little from above and the side.

    turn : by which the camera goes around the subject, counter-clockwise seen from above [rad]
    """
    right, up, front = VIEW
    c, s = math.cos(turn), math.sin(turn)
    towards = subject.axes @ np.array([c * right + s * front, up, c * front - s * right])
    return framing(subject, towards, aspect)

"""The studio: what its camera sees, where its floor is, and that it grows with the subject."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fabricusd.scene.light_kinds import DOME, RECT
from fabricusd.scene.studio import (
    Subject,
    backdrop,
    framing,
    looking,
    studio_camera,
    studio_lights,
)

SHIRT = Subject(low=np.array([-0.3, 0.9, -0.1]), high=np.array([0.3, 1.6, 0.15]))
SIZES = st.floats(1e-3, 1e3)


def seen(camera, points: np.ndarray) -> np.ndarray:
    """(n, 2) places on the film, in halves of the aperture."""
    local = (points - camera.frame[:3, 3]) @ camera.frame[:3, :3]
    film = local[:, :2] / -local[:, 2:] * camera.focal_length
    return film / (np.array(camera.aperture) / 2)


def corners(subject: Subject) -> np.ndarray:
    grid = np.stack(np.meshgrid((0, 1), (0, 1), (0, 1)), -1).reshape(-1, 3)
    return np.stack((subject.low, subject.high))[grid, np.arange(3)]


@given(
    st.tuples(SIZES, SIZES, SIZES), st.tuples(*[st.floats(-1, 1)] * 3), st.floats(0.3, 3),
    st.sampled_from("YZ"),
)  # fmt: skip
def test_a_framed_subject_fills_the_picture_and_stays_inside(size, towards, aspect, up):
    if np.linalg.norm(towards) < 1e-3:
        return
    subject = Subject(low=-np.array(size), high=np.array(size), up_axis=up)
    places = np.abs(seen(framing(subject, np.array(towards), aspect), corners(subject)))
    assert places.max() <= 1.0
    assert places.max() == pytest.approx(1 / 1.08, rel=1e-6)


@pytest.mark.parametrize("turn", [0.0, 1.0, math.pi, -2.0])
def test_the_camera_goes_round_the_subject_at_its_height(turn: float) -> None:
    front, turned = studio_camera(SHIRT), studio_camera(SHIRT, turn=turn)
    directions = [c.frame[:3, 2] for c in (front, turned)]
    assert directions[0][1] == pytest.approx(directions[1][1])
    angle = math.atan2(directions[1][0], directions[1][2]) - math.atan2(
        directions[0][0], directions[0][2]
    )
    assert math.cos(angle) == pytest.approx(math.cos(turn))
    assert math.sin(angle) == pytest.approx(math.sin(turn), abs=1e-9)


def test_a_frame_is_right_handed_and_upright() -> None:
    for eye in ([1.0, 2, 3], [0, 5, 0], [0, -5, 0]):
        frame = looking(np.array(eye, float), np.zeros(3), np.array([0.0, 1.0, 0.0]))[:3, :3]
        assert np.linalg.det(frame) == pytest.approx(1)
        assert frame.T @ frame == pytest.approx(np.eye(3), abs=1e-12)
        assert frame[:, 2] == pytest.approx(np.array(eye) / np.linalg.norm(eye))


def test_the_floor_is_where_the_subject_ends() -> None:
    for subject, axis in ((SHIRT, 1), (Subject(low=SHIRT.low, high=SHIRT.high, up_axis="Z"), 2)):
        points, quads = backdrop(subject)
        assert points[:, axis].min() == pytest.approx(subject.low[axis])
        assert quads.max() == len(points) - 1


def test_lamps_shine_on_the_subject_and_grow_with_it() -> None:
    small = Subject(low=SHIRT.low * 1e-3, high=SHIRT.high * 1e-3)
    for light, tiny in zip(studio_lights(SHIRT), studio_lights(small), strict=True):
        assert light.radiance == tiny.radiance
        if light.kind == DOME:
            continue
        assert light.kind == RECT
        towards = SHIRT.centre - light.frame[:3, 3]
        assert -light.frame[:3, 2] @ towards == pytest.approx(np.linalg.norm(towards))
        assert light.width == pytest.approx(tiny.width * 1e3)

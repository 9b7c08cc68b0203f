"""Setups of cylinders are read, or refused in one line."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.measure.cylinder.setup import frame_at, read_stand
from fabricusd.measure.cylinder.simulate import three_wraps


def whole():
    return {
        "camera": {"position": [0, 0.15, 2.1], "target": [0, 0.15, 0], "view_angle": 29},
        "light": {"direction": [-0.4, 0.5, 0.8], "irradiance": 3.14},
        "cylinders": [
            {"name": "Upright", "x": -0.3, "radius": 0.11, "bottom": 0.1, "top": 0.2, "angle": 0},
            {"name": "Bias", "x": 0.3, "radius": 0.11, "bottom": 0.1, "top": 0.2, "angle": 45,
             "use": "predict"},
        ],
    }  # fmt: skip


def read(tmp_path, given, photographs=1):
    path = tmp_path / "wraps.json"
    path.write_text(given if isinstance(given, str) else json.dumps(given))
    return read_stand(path, photographs)


def test_a_whole_setup_is_read(tmp_path):
    stand = read(tmp_path, whole(), 2)
    assert len(stand.lights) == 2
    assert np.linalg.norm(stand.lights[0]) == pytest.approx(1)
    assert stand.cylinders[1].angle == pytest.approx(math.pi / 4)
    assert [c.use for c in stand.cylinders] == ["fit", "predict"]


def without(key, *rest):
    def change(given):
        for step in rest:
            given = given[step]
        del given[key]

    return change


def with_(value, key, *rest):
    def change(given):
        for step in rest:
            given = given[step]
        given[key] = value

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (without("camera"), "no 'camera'"),
        (without("light"), "no 'light'"),
        (without("direction", "light"), "no light direction"),
        (without("cylinders"), "no 'cylinders'"),
        (with_([], "cylinders"), "no 'cylinders'"),
        (with_([0, 0, 0], "direction", "light"), "length 0"),
        (with_([[0, 0, 1]] * 3, "direction", "light"), "3 light directions; it must have 1, or 1"),
        (with_("far", "view_angle", "camera"), "view_angle is 'far'"),
        (with_(-0.1, "radius", "cylinders", 0), "cylinder 0 radius is -0.1"),
        (with_(0.05, "top", "cylinders", 0), "cylinder 0 top is 0.05"),
        (with_("both", "use", "cylinders", 0), "use is 'both'"),
        (with_("predict", "use", "cylinders", 0), "no cylinder to fit"),
        (with_([0, 5, 0], "position", "camera"), "straight up or down"),
    ],
)
def test_a_setup_with_a_fault_is_refused_by_name(tmp_path, change, words):
    given = whole()
    change(given)
    with pytest.raises(FabricError, match=words) as caught:
        read(tmp_path, given)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "[1]", "{", "null", '{"camera": NaN}'])
def test_what_is_no_setup_is_refused(tmp_path, text):
    with pytest.raises(FabricError):
        read(tmp_path, text)


def test_frames_are_right_handed_and_turn_with_the_weave():
    upright, around, _ = three_wraps().cylinders
    phi = np.linspace(-1, 1, 5)
    for cylinder, up in ((upright, 1), (around, 0)):
        axes = frame_at(cylinder, phi)
        assert np.cross(axes[0], axes[1]) == pytest.approx(axes[2])
        assert axes[up][:, 1] == pytest.approx(1.0)


def test_the_target_lies_in_the_middle_of_the_picture():
    stand = three_wraps()
    assert stand.project(np.array([stand.target]), (180, 720))[0] == pytest.approx([360, 90])
    right = stand.project(np.array([[0.3, 0.15, 0.0]]), (180, 720))[0]
    assert right[0] > 360

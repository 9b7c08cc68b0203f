"""The view that a page asks the path tracer for."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.preview.lights import Lights
from fabricusd.preview.serve.traced import view_of
from fabricusd.preview.shapes import SHAPES
from tests.preview.serve.requests import SOUND

SAID = {key: value for key, value in SOUND["/render"].items() if key not in ("cloth", "shape")}


def test_the_camera_is_that_of_the_page():
    camera = SHAPES["cylinder"](Fabric()).camera()
    eye, right, up = (camera.frame[:3, k].tolist() for k in (3, 0, 1))
    focal = 2.0 * camera.focal_length / camera.aperture[0]
    found = view_of({**SAID, "eye": eye, "right": right, "up": up, "focal": focal}).camera
    assert np.allclose(found.frame, camera.frame, atol=1e-12)
    assert found.focal_length / found.aperture[0] == pytest.approx(
        camera.focal_length / camera.aperture[0]
    )


def test_the_lights_are_those_of_the_page():
    mine = Lights()
    said = {"even": mine.even, "slope": mine.slope, "key": mine.key, "azimuth": -35}
    found = view_of({**SAID, **said, "elevation": 40}).lights
    assert (found.even, found.slope) == pytest.approx((mine.even, mine.slope))
    assert (found.azimuth, found.elevation) == pytest.approx((mine.azimuth, mine.elevation))


@pytest.mark.parametrize(
    ("said", "problem"),
    [
        ({"level": "near"}, "level is unknown"), ({"size": 5000}, "size is not a whole number"),
        ({"samples": 0}, "samples is not a whole number"), ({"eye": [0, 0]}, "eye is not a list"),
        ({"right": [1, 1, 0]}, "is not a number|are not at right angles"),
        ({"right": [0, 1, 0]}, "are not at right angles"), ({"focal": 0}, "focal is not a number"),
        ({"slope": 0.9}, "slope is 0.9; it must be at most 0.3"),
    ],
)  # fmt: skip
def test_what_is_no_view_is_refused(said, problem):
    with pytest.raises(FabricError, match=problem):
        view_of({**SAID, **said})

"""A picture that shows nothing is a finding, and says why."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.reference.render import render, render_scene
from fabricusd.scene.scene import Camera, Mesh, PreviewSurface, Scene
from tests.reference.scenes import looking


def _square(eye, at, clipping, *, orthographic=False):
    """A square of 1 m around the origin, and a camera."""
    points = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    mesh = Mesh(
        path="/m", points=points, triangles=np.array([[0, 1, 2], [0, 2, 3]]),
        material=np.zeros(2, np.int32),
    )  # fmt: skip
    camera = Camera(
        frame=looking(eye, at), clipping=clipping, orthographic=orthographic,
        aperture=(1.0, 1.0) if orthographic else (0.036, 0.024),
    )  # fmt: skip
    return Scene(meshes=[mesh], materials=[PreviewSurface()], camera=camera)


IN_FRONT, BEHIND = (0, 0, 0), (0, 0, 9)
CAMERAS = {
    # the camera at z = 3: (looks at, clipping range [m], what is said; None where it sees)
    "sees": (IN_FRONT, (0.1, 100), None),
    "sees without planes": (IN_FRONT, (0.0, 1e30), None),
    "sees to the plane itself": (IN_FRONT, (2.9, 3.1), None),
    "near plane": (IN_FRONT, (10, 1e6), "the near clipping plane, at 10 m, cuts everything away"),
    "far plane": (IN_FRONT, (0.1, 2), "the far clipping plane, at 2 m, cuts everything away"),
    "both planes": (IN_FRONT, (5, 2), "outside its clipping range, 5 to 2 m"),
    "turned away": (BEHIND, (0.1, 100), "no camera ray hits anything; point the camera"),
    "turned away, behind its planes": (BEHIND, (10, 20), "no camera ray hits anything"),
}


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("name", CAMERAS)
def test_an_empty_picture_says_what_is_in_the_way(name, orthographic):
    at, clipping, words = CAMERAS[name]
    scene = _square((0, 0, 3), at, clipping, orthographic=orthographic)
    result = render_scene(scene, width=16, height=12, spp=1)
    found = [note for note in result.notes if note.startswith("the picture shows nothing")]
    assert result.met == (words is None)
    assert len(found) == (words is not None)
    assert words is None or words in found[0]


def test_a_scene_of_which_nothing_could_be_read_is_an_empty_picture():
    result = render_scene(Scene(), width=4, height=4, spp=1)
    assert not result.met
    assert any("has no triangles to render" in note for note in result.notes)


def test_one_empty_picture_of_several_is_told(tmp_path):
    path = tmp_path / "x.usda"
    path.write_text(
        """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
)
def Mesh "m"
{
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (0, 1, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
}
def Camera "c"
{
    float2 clippingRange = (0.1, 100)
    double3 xformOp:translate.timeSamples = { 1: (0, 0, 3), 2: (0, 0, -3) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    )
    small = {"width": 8, "height": 8, "spp": 1}
    assert render(path, frames=(1.0,), **small).met
    both = render(path, frames=(1.0, 2.0), **small)
    assert not both.met
    assert any("shows nothing" in note for note in both.notes)

"""What `depth` and `uv` hold: a distance along the camera's axis, and one jittered sample."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.reference import render

WALL = """#usda 1.0
(
    metersPerUnit = 0.01
)
def Mesh "Wall"
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-900, -900, 0), (900, -900, 0), (900, 900, 0), (-900, 900, 0)]
    texCoord2f[] primvars:st = [(-9, -9), (9, -9), (9, 9), (-9, 9)] (
        interpolation = "vertex"
    )
    uniform token subdivisionScheme = "none"
}
def Camera "Wide"
{
    float focalLength = 10
    float horizontalAperture = 20
    float verticalAperture = 20
    double3 xformOp:translate = (0, 0, 300)
    double3 xformOp:scale = (2, 2, 2)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}
"""
SIZE = 24


@pytest.fixture(scope="module")
def layers(tmp_path_factory):
    scene = tmp_path_factory.mktemp("wall") / "wall.usda"
    scene.write_text(WALL)
    return [
        render(scene, None, width=SIZE, height=SIZE, spp=spp, aovs=("depth", "uv")).layers
        for spp in (1, 16)
    ]


def test_depth_is_the_distance_along_the_cameras_axis_in_metres(layers):
    # Half the picture is as wide as the wall is far: along the ray corners are 1.7 times as far.
    assert np.allclose(layers[0]["depth"], 3.0, rtol=1e-5)


def test_depth_and_uv_are_those_of_one_sample_anywhere_in_the_filter(layers):
    step = 6.0 / SIZE
    y, x = np.mgrid[0:SIZE, 0:SIZE] + 0.5
    centre = np.stack((x * step - 3, 3 - y * step), axis=-1)
    for made in layers:
        off = np.abs(made["uv"] - centre) / step
        assert off.max() < 1.001
        # Sixteen samples' mean would be within a tenth of a pixel.
        assert np.sqrt(np.mean(off**2)) == pytest.approx(np.sqrt(1 / 6), rel=0.1)

"""Pictures of the preview against the path tracer, and against what is known of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric, even
from fabricusd.preview.fabrics import fabric_of
from fabricusd.preview.lights import Lights
from fabricusd.preview.picture import Picture, preview
from fabricusd.preview.reference import reference_picture
from fabricusd.quality.colors import delta_e_2000
from fabricusd.srgb import srgb_decode

SIZE, SPP = 48, 256


def difference(picture: Picture, radiance: np.ndarray) -> float:
    """Mean delta E 2000 of a preview to a path-traced picture."""
    other = Picture(radiance=radiance[..., :3], cover=radiance[..., 3])
    mine, theirs = (srgb_decode(p.codes() / 255.0) for p in (picture, other))
    return float(delta_e_2000(mine, theirs).mean())


@pytest.mark.parametrize(
    ("name", "shape", "level", "bound"),
    [
        ("linen_plain", "cylinder", "far", 0.5),
        ("linen_plain", "drape", "far", 1.5),
        ("denim", "sphere", "far", 0.5),
        ("denim", "swatch", "far", 0.5),
    ],
)
def test_pictures_are_those_of_the_path_tracer(name, shape, level, bound):
    fabric, _ = fabric_of(name)
    wanted, _ = reference_picture(
        fabric, shape=shape, level=level, size=SIZE, lights=Lights(), spp=SPP
    )
    assert difference(preview(fabric, shape=shape, level=level, size=SIZE), wanted) < bound
    # The bound bites: a light from elsewhere is seen.
    other = preview(fabric, shape=shape, level=level, size=SIZE, lights=Lights(azimuth=0.6))
    assert difference(other, wanted) > bound


def test_the_mean_of_level_weave_is_level_far():
    # Few uneven threads are not as the mean of many.
    fabric = even(fabric_of("linen_plain")[0])
    far, weave = (
        preview(fabric, shape="swatch", level=level, size=64, samples=32)
        for level in ("far", "weave")
    )
    whole = (far.cover == 1) & (weave.cover == 1)
    a, b = (p.radiance[whole].mean(axis=0) for p in (far, weave))
    assert a == pytest.approx(b, rel=0.03)


@pytest.mark.parametrize("name", ["linen_plain", "denim"])
@pytest.mark.parametrize("level", ["far", "weave"])
def test_a_light_from_behind_leaves_the_sky_alone(name, level):
    # Denim lets light through, but not its lining.
    fabric, _ = fabric_of(name)
    behind = Lights(azimuth=math.pi, elevation=0.0)
    lit = preview(fabric, shape="swatch", level=level, size=16, lights=behind)
    dark = preview(fabric, shape="swatch", level=level, size=16, lights=replace(behind, key=0.0))
    assert np.array_equal(lit.radiance, dark.radiance)
    assert lit.radiance[8, 8].min() > 0


def test_light_adds_up():
    fabric, _ = fabric_of("denim")
    both = preview(fabric, size=32)
    key = preview(fabric, size=32, lights=Lights(zenith=0.0, nadir=0.0))
    sky = preview(fabric, size=32, lights=Lights(key=0.0))
    assert both.radiance == pytest.approx(key.radiance + sky.radiance, abs=1e-6)


def test_a_picture_is_the_same_each_time():
    fabric = Fabric()
    once, again = (preview(fabric, level="weave", size=32) for _ in range(2))
    assert np.array_equal(once.radiance, again.radiance)


def test_ground_is_encoded_as_covered_pixels_are():
    some = Picture(
        radiance=np.zeros((1, 2, 3), np.float32), cover=np.array([[0.0, 1e-7]], np.float32)
    )
    codes = some.codes(exposure=1.0)
    assert np.array_equal(codes[0, 0], codes[0, 1])


def test_a_notebook_shows_a_fabric():
    png = Fabric()._repr_png_()
    assert png.startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"shape": "cylindre"}, "shape is 'cylindre'; it must be one of cylinder, sphere"),
        ({"level": "near"}, "level is 'near'; it must be one of far, weave, thread"),
        ({"size": 8}, "size is 8; it must be a whole number from 16 to 4096 pixels"),
        ({"samples": 0}, "samples is 0; it must be a whole number from 1 to 1024"),
    ],
)
def test_settings_that_cannot_be_are_refused(asked, said):
    with pytest.raises(FabricError) as refused:
        preview(Fabric(), **asked)
    assert said in str(refused.value)

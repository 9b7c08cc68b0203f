"""One tile of a fabric as pictures with the names of other tools."""

from __future__ import annotations

import json
from functools import partial

import numpy as np
import OpenImageIO as oiio
import pytest

from fabricusd.cli.main import main
from fabricusd.images.files import read_mip_level
from fabricusd.materials.networks.look import Look
from fabricusd.materials.targets.swatch import pictures, write_swatch
from fabricusd.materials.targets.tile import baked_tile
from fabricusd.schema import load
from fabricusd.srgb import srgb_encode
from tests.materials.scenes import bake_shirt

NAMES = {
    "BaseColor": (3, "uint8"), "Normal_OpenGL": (3, "uint16"), "Normal_DirectX": (3, "uint16"),
    "Roughness": (1, "uint8"), "Anisotropy": (1, "uint8"), "AnisotropyAngle": (1, "uint16"),
    "Opacity": (1, "uint8"), "Height": (1, "uint16"), "ORM": (3, "uint8"),
}  # fmt: skip


@pytest.fixture(scope="module")
def satin():
    return baked_tile(load("polyester_satin_charmeuse"), resolution=128, level="thread")


@pytest.fixture(scope="module")
def swatch(tmp_path_factory):
    folder = tmp_path_factory.mktemp("swatch")
    files = write_swatch(load("linen_plain"), folder, resolution=64, fitted=False)
    return folder, files


def test_it_has_the_names_that_artists_expect_and_says_what_they_hold(swatch):
    folder, files = swatch
    told = json.loads((folder / "linen_plain_swatch.json").read_text())
    assert {f.name for f in files} == {f.name for f in folder.iterdir()}
    assert set(told["pictures"]) == {f"linen_plain_{name}.png" for name in NAMES}
    for name, (channels, kind) in NAMES.items():
        spec = oiio.ImageBuf(str(folder / f"linen_plain_{name}.png")).spec()
        assert (spec.width, spec.nchannels, str(spec.format)) == (64, channels, kind)
        assert told["pictures"][f"linen_plain_{name}.png"]["bits"] == int(kind.strip("uint"))
        assert "fabricusd" in spec.getattribute("Software")
        # PNG holds whole texels a metre.
        per_mm = {"cm": 10.0, "inch": 25.4}[spec.getattribute("ResolutionUnit")]
        assert 64 / (spec.getattribute("XResolution") / per_mm) == pytest.approx(
            told["size_mm"][0], rel=2e-3
        )
    fabric = load("linen_plain")
    width = 1e3 * told["threads"]["warp"] * fabric.warp.pitch
    assert told["size_mm"][0] == pytest.approx(width)
    assert told["texels_per_thread"][0] == 64 / told["threads"]["warp"]
    height = baked_tile(fabric, resolution=64, level="thread").maps["height"]
    assert told["height_scale_m"] == pytest.approx(1e-3 * np.ptp(height))


@pytest.mark.exhaustive
def test_the_numbers_turn_back_into_the_alphas_and_the_axis_of_the_bake(satin):
    look = Look(base_color_scale=(0.9, 0.8, 0.7), smooth_scale=0.8, rough_scale=0.9)
    found = pictures(satin, look)
    smooth = found["Roughness"].pixels ** 2
    level = found["Anisotropy"].pixels
    rough = smooth / np.maximum(1.0 - level, 1e-9)
    assert np.allclose(smooth, np.minimum((0.8 * satin.maps["roughness_along"]) ** 2, 1.0))
    assert np.allclose(
        rough, np.maximum(smooth, np.minimum((0.9 * satin.maps["roughness_across"]) ** 2, 1.0))
    )
    # As Unreal and Unity have it: mean alpha times 1 + a and 1 - a.
    a = level / (2.0 - level)
    alpha = smooth / (1.0 - a)
    assert np.allclose(alpha * (1.0 + a), rough)
    angle = 2 * np.pi * found["AnisotropyAngle"].pixels[..., 0]
    x, y = satin.maps["tangent"][..., 0], satin.maps["tangent"][..., 1]
    # Painter turns clockwise.
    assert np.allclose(np.cos(angle) * y + np.sin(angle) * x, 0.0, atol=1e-6)
    color = satin.maps["base_color"] * look.base_color_scale
    assert np.allclose(found["BaseColor"].pixels, srgb_encode(np.clip(color, 0.0, 1.0)))


@pytest.mark.exhaustive
def test_neither_weft_nor_warp_lies_where_the_angle_starts_again(satin):
    angle = pictures(satin, Look())["AnisotropyAngle"].pixels
    assert ((angle < 0.395) | (angle > 0.855)).mean() < 0.01
    # Weft at half a turn, warp at three quarters: the satin shows both.
    assert {0.5, 0.75} <= set(np.round(angle, 2).ravel().tolist())


def test_the_two_normal_maps_differ_in_green_alone(swatch):
    folder, _ = swatch
    gl, dx = (
        read_mip_level(folder / f"linen_plain_{name}.png")
        for name in ("Normal_OpenGL", "Normal_DirectX")
    )
    assert np.allclose(gl[..., 1] + dx[..., 1], 1.0, atol=1e-4)
    assert np.array_equal(gl[..., ::2], dx[..., ::2])


@pytest.mark.exhaustive
def test_green_and_red_point_down_the_slope(satin):
    """A normal leans away from where the height rises; v rises up the picture."""
    found = pictures(satin, Look())
    normal = 2.0 * found["Normal_OpenGL"].pixels - 1.0
    height = satin.maps["height"][..., 0]
    along_u = np.roll(height, -1, 1) - np.roll(height, 1, 1)
    along_v = np.roll(height, 1, 0) - np.roll(height, -1, 0)
    for slope, lean in ((along_u, normal[..., 0]), (along_v, normal[..., 1])):
        assert np.corrcoef(slope.ravel(), lean.ravel())[0, 1] < -0.2


def test_the_command_writes_a_tile_of_each_fabric(tmp_path, capsys, monkeypatch):
    _, baked = bake_shirt(tmp_path)
    small = partial(write_swatch, resolution=64)
    monkeypatch.setattr("fabricusd.materials.targets.swatch.write_swatch", small)
    words = ["material", str(baked), "-o", str(tmp_path / "look.usda"), "--no-fit"]
    assert main([*words, "--swatch", str(tmp_path / "tiles")]) == 0
    said = capsys.readouterr()
    printed = said.out.split()
    assert str(tmp_path / "tiles" / "velvet_ORM.png") in printed
    assert str(tmp_path / "tiles" / "linen_plain_swatch.json") in printed
    assert "baking the tile of velvet" in said.err

"""Lobes near by as nodes: Cycles renders what `near.mixture` says of a texel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from materials.lobes.mixtures import LEVEL, PAIR, mixture
from materials.near.cloths import mixed, near_mixture, point
from pxr import Sdf, Usd, UsdGeom, UsdShade

from fabricusd.images.files import read_exr_layers
from fabricusd.materials.lobes.inputs import inputs
from fabricusd.materials.lobes.mixture import CYCLES, of_covered
from fabricusd.materials.near.inputs import Laid, near_inputs
from fabricusd.materials.near.maps import texel_pixels, texels_of, write_levels
from fabricusd.materials.near.mixture import constants, evaluate
from fabricusd.materials.networks.graph import Texture
from fabricusd.materials.targets.blender.addon import looks, threads
from fabricusd.materials.targets.write_usd import write_material
from tests.materials.targets.blender.addon.blender import in_blender
from tests.materials.targets.blender.addon.test_lobes import (
    CELLS,
    IRRADIANCE,
    MATRIX,
    SIDE,
    TOWARDS,
    frames,
    write_sheet,
)

FAR = replace(
    mixture(CYCLES, PAIR, replace(LEVEL, tilt=0.4, alpha_along=0.3)), sheen=(0.0, 0.0, 0.0)
)
COVER = 0.9

CASES = {
    "point of the weft": point(1), "point of the warp": point(6), "mixed": mixed(),
    "half a gap": mixed(gap=0.5), "repeat": mixed(seed=5), "afar": mixed(seed=6),
    "half afar": mixed(seed=7), "by distance": mixed(seed=8),
}  # fmt: skip


AFAR = {"afar": 1.0, "half afar": 0.5}
"""The group's input of that name; 0 in all other cases."""

SPAN = 1.3
"""Threads that a pixel spans in the case "by distance", where a square faces the camera."""


def laid(folder, name, texel, density, size=4):
    """Textures all of whose texels are `texel`, or else, of a repeat, all but one quarter."""
    textures, layers = {}, {}
    for key, row in texel_pixels(texel).items():
        pixels = np.tile(row.reshape(1, 1, -1), (size, size, 1))
        path = folder / f"{name}.{key}.exr".replace(" ", "_")
        if name == "repeat":
            pixels[:, size // 2 :] *= 0.0
        write_levels(path, pixels)
        textures[key] = Texture(path)
        layers[key] = pixels.astype(np.float16).astype(np.float32)[:1, :1]
    # The squares show UVs from .15 to .85: an eighth of a repeat, before its middle.
    turned = np.array(((0.5, 0.0, 0.1), (0.0, 0.5, 0.0)))
    found = Laid(textures=textures, density=density)
    if name == "repeat":
        found = Laid(textures=textures, threads=turned, repeat=(2, 4))
    return found, texels_of(layers)


def write_near_sheet(path, texel, along, density=0.0):
    """The sheet of the far mixture, with inputs for one texel; return the texel as it is stored."""
    near = near_mixture(FAR)
    write_sheet(path, FAR, along, COVER)
    textures, stored = laid(path.parent, path.stem, texel, density)
    stage = Usd.Stage.Open(str(path))
    given = inputs(of_covered(FAR, COVER), "cloth", MATRIX) | near_inputs(near, textures, COVER)
    write_material(stage, Sdf.Path("/Sheet/Cloth"), [], given, path.parent)
    UsdShade.Material(stage.GetPrimAtPath("/Sheet/Cloth"))
    stage.GetRootLayer().Save()
    return near, stored


def expected(near, texel, along):
    """(n, 3) radiance of each square."""
    sides = np.where(along[:, 2:, 2] < 0, -1.0, 1.0)
    axes = np.linalg.inv(MATRIX)
    axes = axes / np.linalg.norm(axes, axis=0)
    weft, warp = (axes[0, k] * along[:, 0] + axes[1, k] * along[:, 1] for k in (0, 1))
    frame = np.stack((weft, warp, sides * along[:, 2]), axis=1)
    return IRRADIANCE * evaluate(near, texel, frame @ TOWARDS, frame @ (0.0, 0.0, 1.0))


def width_of(name):
    """Metres of a thread, 0 for none; a pixel is a square's side over SIDE."""
    return 1.0 / SIDE / SPAN if name == "by distance" else 0.0


def away_of(name, along):
    """How much of the cloth from afar each square shows, as a column."""
    if name != "by distance":
        return AFAR.get(name, 0.0)
    span = SPAN / np.sqrt(np.abs(along[:, 2:, 2]))
    found = np.clip(np.log(span / 0.8) / np.log(4.0), 0.0, 1.0)
    assert found.min() < 0.4 < 0.8 < found.max()
    return found


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    """Radiance that Cycles renders, what is expected, and opacity, by the name of the case."""
    along, found, told = frames(), {}, {}
    folder = tmp_path_factory.mktemp("near")
    steps = []
    for name, texel in CASES.items():
        told[name] = write_near_sheet(folder / f"{name}.usda", texel, along)
        steps += [
            {"do": "clear"}, {"do": "bring", "path": str(folder / f"{name}.usda")},
            {"do": "give", "name": "Afar", "value": AFAR.get(name, 0.0)},
            {"do": "give", "name": "Thread Width", "value": width_of(name)},
            {
                "do": "from_above", "picture": str(folder / f"{name}.exr"), "cells": CELLS,
                "towards_light": TOWARDS.tolist(), "irradiance": IRRADIANCE,
                "size": [CELLS * SIDE, CELLS * SIDE], "transparent": True,
            },
        ]  # fmt: skip
    in_blender(folder, *steps)
    for name, (near, texel) in told.items():
        pixels = read_exr_layers(folder / f"{name}.exr")[0]["beauty"][::-1]
        middle = pixels[SIDE // 2 :: SIDE, SIDE // 2 :: SIDE].reshape(CELLS * CELLS, -1)
        cells = pixels.reshape(CELLS, SIDE, CELLS, SIDE, -1)[:, 6:11, :, 6:11, 3]
        away, whole = away_of(name, along), expected(near, near.parts.texel, along)
        truth = (1.0 - away) * expected(near, texel, along) + away * whole
        found[name] = middle[:, :3], truth, cells, texel
    return found


@pytest.mark.parametrize("name", CASES)
def test_cycles_renders_the_lobes_of_the_texel(rendered, name):
    ours, truth, _, _ = rendered[name]
    lit = truth.max(axis=1) > 0.01 * truth.max()
    assert lit.sum() > 15
    assert np.abs(ours - truth)[~lit].max(initial=0.0) < 2e-3 * truth.max()
    assert np.abs(ours[lit] / truth[lit] - 1.0).max() < 2e-3


@pytest.mark.parametrize("name", ["mixed", "half a gap"])
def test_gaps_are_transparent_by_the_shares_of_the_texel(rendered, name):
    """Cycles draws whether a path goes through; of 1600 pixels, a standard deviation is .012."""
    _, _, alpha, texel = rendered[name]
    assert alpha.mean() == pytest.approx(float(texel.sets.sum()), abs=0.05)


def test_the_add_on_reads_what_was_written(tmp_path):
    near, _ = write_near_sheet(tmp_path / "repeat.usda", mixed(), frames())
    (look,) = looks.read(Usd.Stage.Open(str(tmp_path / "repeat.usda")))
    read = look.threads
    assert read.share == pytest.approx(near.parts.share, rel=1e-6)
    assert np.array(read.factors) == pytest.approx(near.factors * COVER, rel=1e-6)
    assert read.matrix == pytest.approx((0.5, 0.0, 0.0, 0.5, 0.1, 0.0))
    assert read.repeat == (2.0, 4.0)
    assert [name for name, _ in read.files] == list(threads.TEXTURES)
    for number, (lobe, _) in enumerate(near.lobes):
        mine = threads.turning(read, number, lobe.color, lobe.along)
        known = constants(near, number)
        assert mine.mean == pytest.approx(known.mean, abs=1e-6)
        assert mine.variance == pytest.approx(known.variance, abs=1e-6)


@pytest.mark.parametrize("lost", ["own", "factors", "lobes_lean"])
def test_a_look_that_lacks_a_part_of_the_threads_is_the_cloth_from_afar(tmp_path, lost):
    write_near_sheet(tmp_path / "repeat.usda", mixed(), frames())
    stage = Usd.Stage.Open(str(tmp_path / "repeat.usda"))
    stage.GetPrimAtPath("/Sheet/Cloth").RemoveProperty(f"inputs:cycles:near:{lost}")
    (look,) = looks.read(stage)
    assert look.threads is None
    assert look.mixture is not None


CAMERAS = {
    # lens, sensor [mm], size of the picture: width of a pixel for a metre of distance, and beside
    "wide": ({"lens": 50.0, "sensor_width": 36.0}, (1000, 500), 0.72e-3, 0.0),
    "tall": ({"lens": 50.0, "sensor_width": 36.0}, (500, 1000), 0.72e-3, 0.0),
    "tall, by width": (
        {"lens": 50.0, "sensor_width": 36.0, "sensor_fit": "HORIZONTAL"}, (500, 1000), 1.44e-3, 0.0,
    ),
    "wide, by height": (
        {"lens": 50.0, "sensor_height": 24.0, "sensor_fit": "VERTICAL"}, (1000, 500), 0.96e-3, 0.0,
    ),
    "orthographic": ({"type": "ORTHO", "ortho_scale": 2.0}, (1000, 500), 0.0, 2e-3),
    "panoramic": ({"type": "PANO"}, (1000, 500), 6.2832e-3, 0.0),
}  # fmt: skip


def test_the_width_of_a_pixel_follows_the_camera(tmp_path):
    write_near_sheet(tmp_path / "mixed.usda", mixed(), frames())
    steps = [{"do": "bring", "path": str(tmp_path / "mixed.usda")}]
    steps += [{"do": "pixel", "camera": c, "size": size} for c, size, *_ in CAMERAS.values()]
    camera, size, *_ = CAMERAS["wide"]
    steps.append({"do": "pixel", "camera": camera, "size": size, "percentage": 50})
    told = in_blender(tmp_path, *steps)
    for (*_, per_metre, alone), found in zip(CAMERAS.values(), told[1:], strict=False):
        assert found == pytest.approx([per_metre, alone], rel=1e-4)
    assert told[-1] == pytest.approx([1.44e-3, 0.0], rel=1e-4)


def test_the_width_of_a_thread_comes_from_the_mesh(tmp_path):
    """A UV of 1 is a metre of the sheet; its parent doubles it, and one thread in 12 is a UV."""
    path = tmp_path / "mixed.usda"
    write_near_sheet(path, mixed(), frames(), density=12.0)
    stage = Usd.Stage.Open(str(path))
    UsdGeom.XformCommonAPI(stage.GetPrimAtPath("/Sheet/Squares")).SetScale((2.0, 2.0, 2.0))
    stage.GetRootLayer().Save()
    told = in_blender(
        tmp_path, {"do": "bring", "path": str(path)},
        {"do": "inputs_named", "name": "Thread Width"}, {"do": "inputs_named", "name": "Afar"},
    )  # fmt: skip
    assert told[1] == {"Cloth": pytest.approx(2.0 / 12.0, rel=1e-4)}
    assert told[2] == {"Cloth": 0.0}

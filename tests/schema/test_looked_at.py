"""Scenes that once gave a wrong picture, and one that was right and stays so."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from fabricusd.reference import render
from fabricusd.scene.usd.stage import read_usd_scene
from fabricusd.schema import check, load, save

CASES = Path(__file__).parents[1] / "cases" / "looked_at"

SATIN = "polyester_satin_charmeuse"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The cases, with the preset that two of them need beside them."""
    shutil.copytree(CASES, tmp_path, dirs_exist_ok=True)
    save(load(f"{SATIN}{{appearance=published}}"), tmp_path / f"{SATIN}.usda")
    return tmp_path


def test_the_back_of_a_satin_is_the_same_by_reference_and_by_sublayer(folder):
    pictures = []
    for name in ("back_reference", "back_sublayer"):
        scene = folder / f"{name}.usda"
        assert check(scene) == []
        made = render(scene, None, width=16, height=16, spp=4)
        assert made.notes == ()
        pictures.append(made.layers["beauty"])
    assert np.array_equal(*pictures)
    # Of the shiny side, mirrored, it would be .44.
    color = pictures[0][..., :3][pictures[0][..., 3] > 0.5].mean(axis=0)
    assert 0.2 < color[0] < 0.35


def test_a_fabric_below_an_over_is_worn_with_a_note_and_a_finding(folder):
    scene = folder / "fabric_under_over.usda"
    read = read_usd_scene(scene)
    (surface,) = read.materials
    # The layer holds the linen as it was written then: thicker threads, another text.
    worn, linen = surface.binding.fabric, load("linen_plain")
    assert (worn.name, worn.weave, worn.warp, worn.weft) == (
        linen.name, linen.weave, linen.warp, linen.weft,
    )  # fmt: skip
    assert worn.threads["Linen"].curve == linen.threads["Linen"].curve
    assert len(read.notes) == 1
    assert "/World/Looks, an 'over'" in read.notes[0]
    assert "BoundFabricDefined" in {f.rule for f in check(scene) if f.severity == "error"}


SQUARE = """#usda 1.0
(
    metersPerUnit = 1
    subLayers = [@marked.usda@]
)
def Mesh "Square" (
    prepend apiSchemas = ["WovenBindingAPI"]
)
{
    rel fabric:binding = </marked>
    double2 fabric:binding:threadsPerUnit = (8, 8)
    double fabric:binding:rotation = 30
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    texCoord2f[] primvars:st = [(-1, -1), (1, -1), (1, 1), (-1, 1)] (
        interpolation = "vertex"
    )
    uniform token subdivisionScheme = "none"
}
def Camera "Front"
{
    token projection = "orthographic"
    float horizontalAperture = 10
    float verticalAperture = 10
    double3 xformOp:translate = (0, 0, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""

ROWS = ("1011", "1101", "1110", "0111")
COLORS = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (1, 1, 0), (0, 1, 1)], float)


def test_stripes_and_grain_of_a_marked_cloth_lie_where_the_file_says(folder):
    assert check(folder / "marked.usda") == []
    (folder / "square.usda").write_text(SQUARE)
    layers = render(
        folder / "square.usda", None, width=64, height=64, spp=1, level="weave", shadow="none",
        aovs=("uv", "thread", "albedo"),
    ).layers  # fmt: skip
    uv = layers["uv"].reshape(-1, 2).astype(float)
    # The weft runs 30 degrees counter-clockwise from u, so ends are counted that way.
    angle = np.radians(30)
    ends = 8 * uv @ (np.cos(angle), np.sin(angle))
    picks = 8 * uv @ (-np.sin(angle), np.cos(angle))
    inside = (np.abs(ends % 1 - 0.5) < 0.48) & (np.abs(picks % 1 - 0.5) < 0.48)
    i, j = (np.floor(x).astype(int) % 4 for x in (ends, picks))
    warp = np.array([[c == "1" for c in row] for row in ROWS])[j, i]
    number = np.where(warp, 6 + i, 4 + j % 2)
    assert inside.mean() > 0.8
    assert (layers["thread"].reshape(-1) == number)[inside].all()
    # What is sent back has the channels of the thread's colour, above the white surface's share.
    sent = layers["albedo"].reshape(-1, 3)
    for kind, color in enumerate(COLORS):
        mean = sent[inside & (number % 6 == kind)].mean(axis=0)
        if 0 < color.sum() < 3:
            assert mean[color == 1].min() > 1.5 * mean[color == 0].max(), kind
        else:
            assert np.ptp(mean) < 1e-3, kind


@pytest.fixture
def shot(tmp_path: Path) -> Path:
    """The cases, with shot silk beside them."""
    shutil.copytree(CASES, tmp_path, dirs_exist_ok=True)
    save(load("silk_shot"), tmp_path / "silk_shot.usda")
    return tmp_path


def green_over_red(scene, **settings):
    made = render(scene, None, width=48, height=48, spp=32, **settings)
    color = made.layers["beauty"][8:-8, 8:-8, :3].mean(axis=(0, 1))
    return float(color[1] / color[0])


@pytest.mark.parametrize("level", ["weave", "thread"])
def test_shot_silk_has_one_hue_at_every_level_with_shadows(shot, level):
    scene = shot / "a_silk_shot_4.usda"
    far = green_over_red(scene, level="far")
    assert green_over_red(scene, level=level) == pytest.approx(far, rel=0.05)


def test_shot_silk_keeps_its_hue_as_the_camera_comes_near(shot):
    hues = [green_over_red(shot / "dolly_silk_shot.usda", frames=(k,)) for k in (1, 3, 5, 8)]
    assert max(hues) / min(hues) < 1.05


def test_shot_silk_has_one_hue_at_every_level_without_shadows(shot):
    scene = shot / "a_silk_shot_4.usda"
    hues = [green_over_red(scene, level=k, shadow="none") for k in ("far", "weave", "thread")]
    assert max(hues) / min(hues) < 1.05

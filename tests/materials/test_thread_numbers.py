"""A bake and a picture number threads alike, point by point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.lookup import NO_THREAD
from fabricusd.bake.bake import bake
from fabricusd.bake.error.relight import BakedSet
from fabricusd.bake.job import Settings
from fabricusd.bake.texels.encoding import FORMATS
from fabricusd.fabric import Binding, Fabric, Thread, ThreadSet
from fabricusd.reference import render
from fabricusd.schema import load, published_names
from tests.appearance.presets import often

TEXELS, PIXELS = 128, 64
"""Of map and picture. With half as many texels the satin's weft lies between their centres."""

SQUARE = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
)
def Mesh "Square"
{
    uniform bool doubleSided = 1
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
        interpolation = "vertex"
    )
    uniform token subdivisionScheme = "none"
}
def Camera "Front"
{
    token projection = "orthographic"
    float horizontalAperture = 9.6
    float verticalAperture = 9.6
    double3 xformOp:translate = (0.5, 0.5, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "Back"
{
    token projection = "orthographic"
    float horizontalAperture = 9.6
    float verticalAperture = 9.6
    double3 xformOp:translate = (0.5, 0.5, -1)
    double3 xformOp:rotateXYZ = (0, 180, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
"""

ONE_YARN_IN_BOTH_SETS = Fabric(
    threads={"A": Thread(), "B": Thread()},
    warp=ThreadSet(sequence=(0, 1), coverage=0.4),
    weft=ThreadSet(sequence=(1, 0), coverage=0.3),
)
CLOTHS = {name: load(name) for name in published_names()} | {"one yarn": ONE_YARN_IN_BOTH_SETS}


@pytest.fixture(scope="module")
def square(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("square") / "square.usda"
    path.write_text(SQUARE)
    return path


def one_repeat(fabric: Fabric) -> Binding:
    ends, picks = true_repeat(fabric)
    return Binding(fabric=fabric, threads_per_uv=(float(ends), float(picks)))


def baked(
    square: Path, fabric: Fabric, folder: Path, file_format: str = "exr"
) -> NDArray[np.int64]:
    """(TEXELS, TEXELS) map `thread_id` of the square, its first row at v = 1."""
    settings = Settings(resolution=TEXELS, maps=("thread_id",), file_format=file_format)
    bake(square, folder, settings, fabric=one_repeat(fabric))
    return BakedSet.load(folder).read("Square", "thread_id")[..., 0].astype(np.int64)


def seen(
    square: Path, fabric: Fabric, camera: str
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Layers `thread` and `uv` of a picture of the square."""
    layers = render(
        square, None, fabric=one_repeat(fabric), camera=camera, width=PIXELS, height=PIXELS, spp=1,
        max_bounces=0, level="weave", shadow="none", aovs=("thread", "uv"),
    ).layers  # fmt: skip
    return layers["thread"][..., 0].astype(np.int64), layers["uv"]


def inside(ids: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Texels whose neighbours show the same thread."""
    same = np.ones(ids.shape, bool)
    for axis in (0, 1):
        for shift in (-1, 1):
            same &= np.roll(ids, shift, axis) == ids
    return same


@pytest.mark.parametrize("name", often(CLOTHS, ("linen_plain", "one yarn")))
def test_the_thread_of_a_texel_is_the_thread_of_a_pixel(name, square, tmp_path):
    ids = baked(square, CLOTHS[name], tmp_path)
    threads, uv = seen(square, CLOTHS[name], "/Front")
    assert set(np.unique(ids)) == set(np.unique(threads))
    met = threads != NO_THREAD
    column = np.clip((uv[..., 0] * TEXELS).astype(int), 0, TEXELS - 1)
    row = np.clip(((1 - uv[..., 1]) * TEXELS).astype(int), 0, TEXELS - 1)
    judged = met & inside(ids)[row, column]
    assert judged.mean() > 0.3
    assert (threads == ids[row, column])[judged].all()


def test_a_yarn_in_both_sets_has_two_numbers(square, tmp_path):
    expected = {0, 1, 2, 3, NO_THREAD}
    assert set(np.unique(baked(square, ONE_YARN_IN_BOTH_SETS, tmp_path))) == expected


def test_files_without_negative_numbers_hold_none_too(square, tmp_path):
    found = {kind: baked(square, ONE_YARN_IN_BOTH_SETS, tmp_path / kind, kind) for kind in FORMATS}
    for kind in FORMATS:
        assert np.array_equal(found[kind], found["exr"])


def test_a_back_of_its_own_is_numbered_by_its_own_threads(square):
    back = Fabric(
        threads={"A": Thread(), "B": Thread(), "C": Thread()},
        warp=ThreadSet(sequence=(1,), coverage=0.5),
        weft=ThreadSet(sequence=(2,), coverage=0.5),
    )
    threads, _ = seen(square, Fabric(back=back), "/Back")
    assert set(np.unique(threads)) == {2, 3 + 1}

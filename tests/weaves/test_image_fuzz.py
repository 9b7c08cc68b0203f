"""Damaged images: a weave or one line of error, in bounded time and memory, without a crash."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from fabricusd.images.files import read_image as read_picture
from fabricusd.images.files import read_mip_level, read_part
from fabricusd.weaves import read_image
from tests import fuzz
from tests.png import png

CELLS = np.random.default_rng(0).random((20, 16)) < 0.5
GREY = Image.fromarray(np.where(CELLS, 255, 0).astype(np.uint8))
SIZES = [struct.pack(order + "I", n) for n in (16, 20, 16384, 65535) for order in "<>"]
SAVED = {
    "png": [(GREY, {}), (GREY.convert("1"), {}), (GREY.convert("P"), {})],
    "tif": [(GREY, {}), (GREY.convert("1"), {"compression": "group4"}), (GREY.convert("P"), {})],
    "bmp": [(GREY, {}), (GREY.convert("1"), {})],
    "gif": [(GREY, {}), (GREY, {"save_all": True, "append_images": [GREY.rotate(180)]})],
    "jpg": [(GREY, {"quality": 90})],
    "webp": [(GREY, {"lossless": True})],
    "jp2": [(GREY, {})],
    "tga": [(GREY.convert("RGB"), {})],
    "ppm": [(GREY, {}), (GREY.convert("1"), {})],
    "ico": [(GREY, {})],
}


def saved(suffix: str) -> list[bytes]:
    files = []
    for picture, options in SAVED[suffix]:
        stream = io.BytesIO()
        kind = {"jpg": "jpeg", "tif": "tiff", "jp2": "jpeg2000"}.get(suffix, suffix)
        picture.save(stream, kind, **options)
        files.append(stream.getvalue())
    return files


def exr(folder: Path, name: str, tiled: bool) -> bytes:
    spec = oiio.ImageSpec(16, 16, 3, oiio.HALF)
    if tiled:
        spec.tile_width = spec.tile_height = 16
    output = oiio.ImageOutput.create(str(folder / name))
    assert output.open(str(folder / name), spec)
    assert output.write_image(np.repeat(CELLS[:16, :, None], 3, axis=2).astype(np.float16))
    output.close()
    return (folder / name).read_bytes()


@pytest.mark.parametrize("suffix", SAVED)
def test_a_mutated_image_is_a_weave_or_one_line_of_error(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a.{suffix}"

    @settings(max_examples=fuzz.examples(40, 9000))
    @given(fuzz.mutated(saved(suffix), (*fuzz.WORDS, *SIZES)))
    def try_one(data: bytes) -> None:
        path.write_bytes(data)
        fuzz.refusal(read_image, path)

    try_one()


@settings(max_examples=fuzz.examples(60, 9000))
@given(
    st.integers(0, 40) | st.sampled_from([8192, 16384, 16385, 2**31 - 1]),
    st.integers(0, 40) | st.sampled_from([8192, 16384, 16385, 2**31 - 1]),
    st.binary(max_size=400) | st.integers(0, 5000).map(bytes),
    st.sampled_from([1, 2, 4, 8, 16, 3]),
    st.sampled_from([0, 2, 3, 4, 6, 5]),
)
def test_a_png_with_its_sums_right_is_a_weave_or_one_line_of_error(
    tmp_path: Path, width: int, height: int, pixels: bytes, depth: int, kind: int
) -> None:
    """Mutated bytes do not get past the sums of a PNG."""
    (tmp_path / "a.png").write_bytes(png(width, height, pixels, depth=depth, kind=kind))
    fuzz.refusal(read_image, tmp_path / "a.png")


@pytest.mark.parametrize("tiled", [False, True])
def test_a_mutated_exr_is_read_or_refused_by_every_reader(tmp_path: Path, tiled: bool) -> None:
    path = tmp_path / "a.exr"
    seed = exr(tmp_path, "whole.exr", tiled)

    @settings(max_examples=fuzz.examples(40, 9000))
    @given(fuzz.mutated(seed, (*fuzz.WORDS, *SIZES)))
    def try_one(data: bytes) -> None:
        path.write_bytes(data)
        fuzz.refusal(read_image, path)
        fuzz.refusal(read_picture, path)
        fuzz.refusal(read_mip_level, path)
        fuzz.refusal(read_part, path, 64)

    try_one()

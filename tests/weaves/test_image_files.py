"""Image files of every sort: read right, or refused in one line and in bounded memory."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fabricusd.errors import FabricError
from fabricusd.weaves import read_image
from tests.png import png

CELLS = np.kron(np.array([[1, 1, 0], [0, 1, 1], [0, 0, 1], [1, 0, 0]], bool), np.ones((8, 8), bool))
PIXELS = np.where(CELLS.T[::-1], 0, 255).astype(np.uint8)
GREY = Image.fromarray(PIXELS)
OTHER = Image.fromarray(255 - PIXELS)


def palette_with_a_clear_colour() -> Image.Image:
    """White is transparent, and stored as black."""
    picture = Image.fromarray((PIXELS // 255).astype(np.uint8), "P")
    picture.putpalette([0, 0, 0, 0, 0, 0])
    picture.info["transparency"] = 1
    return picture


KINDS = {
    "1-bit PNG": ("a.png", GREY.convert("1"), {}),
    "1-bit TIFF": ("a.tif", GREY.convert("1"), {}),
    "1-bit TIFF, white is zero": ("a.tif", GREY.convert("1"), {"tiffinfo": {262: 0}}),
    "fax": ("a.tif", GREY.convert("1"), {"compression": "group4"}),
    "1-bit BMP": ("a.bmp", GREY.convert("1"), {}),
    "1-bit PBM": ("a.pbm", GREY.convert("1"), {}),
    "palette PNG": ("a.png", GREY.convert("P"), {}),
    "palette PNG with a clear colour": ("a.png", palette_with_a_clear_colour(), {}),
    "palette TIFF": ("a.tif", GREY.convert("P"), {}),
    "palette BMP": ("a.bmp", GREY.convert("P"), {}),
    "GIF": ("a.gif", GREY, {}),
    "WebP": ("a.webp", GREY, {"lossless": True}),
    "JPEG 2000": ("a.jp2", GREY, {}),
    "grey with opacity": ("a.png", GREY.convert("LA"), {}),
    "inks": ("a.tif", GREY.convert("CMYK"), {}),
}


@pytest.mark.parametrize("case", KINDS)
def test_every_usual_kind_of_pixel_is_read_right(tmp_path: Path, case: str) -> None:
    name, picture, options = KINDS[case]
    picture.save(tmp_path / name, **options)
    draft = read_image(tmp_path / name)
    assert np.array_equal(draft.weave.cells, CELLS)
    assert draft.warnings == ()


@pytest.mark.parametrize("suffix", [".gif", ".webp", ".tif"])
def test_of_several_pictures_the_first_is_read_with_a_warning(tmp_path: Path, suffix: str) -> None:
    options = {"lossless": True} if suffix == ".webp" else {}
    GREY.save(tmp_path / f"a{suffix}", save_all=True, append_images=[OTHER, OTHER], **options)
    draft = read_image(tmp_path / f"a{suffix}")
    assert np.array_equal(draft.weave.cells, CELLS)
    assert draft.warnings == ("The file holds several pictures; the first is read.",)


def gif(width: int, height: int) -> bytes:
    head = b"GIF89a" + struct.pack("<HHBBB", width, height, 0x80, 0, 0) + b"\0\0\0\xff\xff\xff"
    return head + b"\x2c\0\0\0\0\1\0\1\0\0" + b"\x02\x02\x44\x01\0" + b"\x3b"


def bmp(width: int, height: int) -> bytes:
    head = struct.pack("<IiiHHIIiiII", 40, width, height, 1, 24, 0, 0, 0, 0, 0, 0)
    return b"BM" + struct.pack("<IHHI", 54 + 16, 0, 0, 54) + head + bytes(16)


def jpeg_2000(width: int, height: int) -> bytes:
    head = struct.pack(">IIHBBBB", height, width, 3, 7, 7, 0, 0)
    boxes = struct.pack(">I4s", 22, b"ihdr") + head
    start = b"\0\0\0\x0cjP  \r\n\x87\n\0\0\0\x14ftypjp2 \0\0\0\0jp2 "
    return start + struct.pack(">I4s", 8 + len(boxes), b"jp2h") + boxes


HUGE = {
    "PNG": png(16384, 8192, bytes(100)),
    "PNG of more than there can be": png(2**31 - 1, 2**31 - 1, bytes(100)),
    "PNG of 16 bits and four channels": png(16384, 8192, bytes(100), depth=16, kind=6),
    "GIF, whose canvas is made when it is opened": gif(16384, 8192),
    "BMP": bmp(16384, 8192),
    "JPEG 2000, which is decoded when it is opened": jpeg_2000(16384, 8192),
    "PGM": b"P5\n16000 8000\n255\n0000",
    "PGM of negative size": b"P5\n-1 -1\n255\n",
    "PGM of a size beyond integers": b"P5\n99999999999999999999 1\n255\n",
    "TGA": bytes((0, 0, 2, *(9 * [0]))) + struct.pack("<HHBB", 16384, 8192, 24, 0) + b"123",
}

READ = """
import json, re, sys
from fabricusd.errors import FabricError
from fabricusd.weaves.image.read import read_image
def peak():
    return int(re.search(r"VmHWM:\\s*(\\d+) kB", open("/proc/self/status").read())[1]) / 1024
read_image(sys.argv[1])
before = peak()
try:
    result = int(read_image(sys.argv[2]).weave.cells.sum())
except FabricError as error:
    result = str(error)
print(json.dumps([before, peak(), result]))
"""


def peaks(tmp_path: Path, data: bytes) -> tuple[float, float, int | str]:
    """(MiB of a process that has read a small picture, and has read this; cells or refusal)."""
    GREY.save(tmp_path / "small.png")
    (tmp_path / "image.bin").write_bytes(data)
    run = subprocess.run(
        [sys.executable, "-c", READ, str(tmp_path / "small.png"), str(tmp_path / "image.bin")],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    before, after, result = json.loads(run.stdout)
    return before, after, result


only_linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has /proc")


@only_linux
@pytest.mark.parametrize("case", HUGE)
def test_a_small_file_that_says_it_is_huge_is_refused_before_memory_is_taken(
    tmp_path: Path, case: str
) -> None:
    before, after, message = peaks(tmp_path, HUGE[case])
    assert str(message).startswith(str(tmp_path / "image.bin"))
    assert str(message).isprintable()
    assert after - before < 40  # the smallest of them would take 128


@only_linux
def test_the_largest_picture_is_read_in_500_megabytes(tmp_path: Path) -> None:
    """130 kB that unpack to 128 MB, all of it white but the first pixel."""
    rows = bytearray(b"\xff" * (16385 * 8192))
    rows[::16385] = bytes(8192)
    rows[1] = 0
    _, after, cells = peaks(tmp_path, png(16384, 8192, bytes(rows)))
    assert cells == 1
    assert after < 500  # measured 420


def test_a_picture_of_too_many_pixels_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(png(16384, 16384, bytes(100), depth=1))
    with pytest.raises(FabricError, match="has 268435456 pixels; it must have at most 134217728"):
        read_image(path)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".bmp", ".gif", ".jpg", ".webp", ".jp2"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_picture_that_is_cut_off_is_refused_or_whole(
    tmp_path: Path, suffix: str, share: float
) -> None:
    noise = np.random.default_rng(0).integers(0, 2, (120, 160)) * 255
    whole = tmp_path / f"whole{suffix}"
    Image.fromarray(noise.astype(np.uint8)).save(
        whole, **({"lossless": True} if suffix == ".webp" else {})
    )
    data = whole.read_bytes()
    cut = tmp_path / f"cut{suffix}"
    cut.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(FabricError) as caught:
        read_image(cut)
    assert str(caught.value).startswith(str(cut))
    assert str(caught.value).isprintable()

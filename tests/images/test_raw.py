"""Raw frames: codes as the file has them, and one line for what is no raw frame."""

from __future__ import annotations

import struct
import sys

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.images.files import write_exr, write_png
from fabricusd.images.raw import read_codes, write_codes

CODES = np.random.default_rng(0).integers(0, 4096, (12, 20)).astype(np.uint16)


@pytest.mark.parametrize("suffix", [".tif", ".png", ".pgm"])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_codes_are_read_as_they_were_written(suffix, kind, tmp_path):
    codes = (CODES >> 4).astype(kind) if kind == np.uint8 else CODES
    path = tmp_path / f"a{suffix}"
    write_codes(path, codes)
    found = read_codes(path)
    assert found.dtype == kind
    np.testing.assert_array_equal(found, codes)


@pytest.mark.parametrize("largest", [4095, 1023, 200])
def test_a_pgm_of_fewer_levels_keeps_its_codes(largest, tmp_path):
    codes = CODES % (largest + 1)
    data = codes.astype(">u2" if largest > 255 else np.uint8).tobytes()
    path = tmp_path / "a.pgm"
    path.write_bytes(b"P5\n# a remark\n20 12\n%d\n" % largest + data)
    np.testing.assert_array_equal(read_codes(path), codes)


@pytest.mark.parametrize("suffix", [".tif", ".png", ".pgm"])
def test_a_truncated_frame_is_refused_and_nothing_is_printed(suffix, tmp_path, capfd):
    path = tmp_path / f"a{suffix}"
    write_codes(path, CODES)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(FabricError) as error:
        read_codes(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)
    assert capfd.readouterr().err == ""


def test_pictures_that_are_no_raw_frames_are_refused(tmp_path):
    write_png(tmp_path / "rgb.png", np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(FabricError, match="has 3 channels; a raw frame must have one code"):
        read_codes(tmp_path / "rgb.png")
    write_exr(tmp_path / "f.exr", {"beauty": np.zeros((4, 4, 1))}, {"beauty": ("Y",)}, {})
    with pytest.raises(FabricError, match="holds float; a raw frame must hold 8 or 16 bit"):
        read_codes(tmp_path / "f.exr")
    (tmp_path / "a.tif").write_text("no picture at all")
    with pytest.raises(FabricError, match="cannot be read as a raw frame"):
        read_codes(tmp_path / "a.tif")


def test_a_camera_s_file_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rawpy", None)
    (tmp_path / "a.dng").write_bytes(b"II*\0")
    with pytest.raises(FabricError, match=r"needs rawpy, .* pip install 'fabricusd\[raw\]'"):
        read_codes(tmp_path / "a.dng")


def dng(codes) -> bytes:
    """The least DNG that LibRaw reads: one uncompressed strip of 16-bit RGGB codes."""
    h, w = codes.shape
    pixels = codes.astype("<u2").tobytes()
    matrix = [1, 1, 0, 1, 0, 1, 0, 1, 1, 1, 0, 1, 0, 1, 0, 1, 1, 1]
    tags = [
        (254, "I", [0]), (256, "I", [w]), (257, "I", [h]), (258, "H", [16]), (259, "H", [1]),
        (262, "H", [32803]), (271, "s", b"Made\0"), (272, "s", b"Made up\0"), (273, "I", [0]),
        (277, "H", [1]), (278, "I", [h]), (279, "I", [len(pixels)]), (284, "H", [1]),
        (33421, "H", [2, 2]), (33422, "B", [0, 1, 1, 2]), (50706, "B", [1, 4, 0, 0]),
        (50708, "s", b"Made up\0"), (50714, "H", [0]), (50717, "I", [4095]), (50721, "i", matrix),
    ]  # fmt: skip
    numbers = {"B": 1, "s": 2, "H": 3, "I": 4, "i": 10}
    entries, longer, where = b"", b"", 8 + 2 + 12 * len(tags) + 4
    packed = {
        tag: values if code == "s" else struct.pack(f"<{len(values)}{code}", *values)
        for tag, code, values in tags
    }
    pixels_at = where + sum(len(d) + len(d) % 2 for d in packed.values() if len(d) > 4)
    for tag, code, values in tags:
        data = struct.pack("<I", pixels_at) if tag == 273 else packed[tag]
        count = len(values) // 2 if code == "i" else len(values)
        entries += struct.pack("<HHI", tag, numbers[code], count)
        if len(data) > 4:
            entries += struct.pack("<I", where + len(longer))
            longer += data + b"\0" * (len(data) % 2)
        else:
            entries += data.ljust(4, b"\0")
    return b"II*\0" + struct.pack("<IH", 8, len(tags)) + entries + bytes(4) + longer + pixels


def test_a_dng_is_read_by_rawpy_as_the_codes_that_it_holds(tmp_path, capfd):
    pytest.importorskip("rawpy")
    codes = np.random.default_rng(0).integers(0, 4096, (64, 96)).astype(np.uint16)
    path = tmp_path / "a.dng"
    path.write_bytes(dng(codes))
    np.testing.assert_array_equal(read_codes(path), codes)
    path.write_bytes(dng(codes)[:3000])
    with pytest.raises(FabricError, match="cannot be read as a raw frame"):
        read_codes(path)
    assert capfd.readouterr().err == ""

"""Pictures as terminals take them."""

from __future__ import annotations

import base64
import re

import numpy as np
import OpenImageIO as oiio
import pytest

from fabricusd.preview.png import png_bytes
from fabricusd.preview.terminal import has_sixel, iterm2, kitty, protocol_of, sixel


@pytest.mark.parametrize(
    ("variables", "protocol"),
    [
        ({"TERM": "xterm-kitty"}, "kitty"),
        ({"KITTY_WINDOW_ID": "1"}, "kitty"),
        ({"TERM_PROGRAM": "ghostty"}, "kitty"),
        ({"TERM_PROGRAM": "iTerm.app"}, "iterm2"),
        ({"LC_TERMINAL": "iTerm2", "TERM": "screen"}, "iterm2"),
        ({"TERM_PROGRAM": "WezTerm"}, "iterm2"),
        ({"TERM": "xterm-256color"}, ""),
        ({}, ""),
    ],
)
def test_terminals_are_known_by_their_variables(variables, protocol):
    assert protocol_of(variables) == protocol


@pytest.mark.parametrize(
    ("answer", "has"),
    [("\x1b[?62;4;6c", True), ("\x1b[?62;22c", False), ("\x1b[?4c", False), ("", False)],
)  # fmt: skip
def test_sixel_is_the_fourth_attribute(answer, has):
    assert has_sixel(answer) == has


def test_kitty_gets_the_whole_png_in_pieces():
    png = bytes(range(256)) * 40
    pieces = re.findall(r"\x1b_G([^;]*);([^\x1b]*)\x1b\\", kitty(png))
    assert base64.b64decode("".join(p for _, p in pieces)) == png
    assert [head.rpartition("m=")[2] for head, _ in pieces] == ["1"] * (len(pieces) - 1) + ["0"]
    assert pieces[0][0].startswith("a=T,f=100")


def test_iterm2_gets_the_whole_png():
    found = re.fullmatch(r"\x1b\]1337;File=inline=1;size=3:(.*)\a\n", iterm2(b"abc"))
    assert found
    assert base64.b64decode(found[1]) == b"abc"


def decoded(text: str) -> np.ndarray:
    """The picture that sixel draws."""
    body = re.fullmatch(r'\x1bPq"1;1;(\d+);(\d+)(.*)\x1b\\\n', text, re.S)
    assert body
    w, h = int(body[1]), int(body[2])
    out = np.full((-(-h // 6) * 6, w, 3), -1.0)
    palette, color, x, top = {}, 0, 0, 0
    token = r"#(\d+);2;(\d+);(\d+);(\d+)|#(\d+)|!(\d+)([?-~])|([?-~])|(\$)|(-)"
    for one in re.finditer(token, body[3]):
        if one[1]:
            palette[int(one[1])] = [float(one[k]) / 100 for k in (2, 3, 4)]
        elif one[5]:
            color = int(one[5])
        elif one[9]:
            x = 0
        elif one[10]:
            x, top = 0, top + 6
        else:
            bits, count = ord(one[7] or one[8]) - 63, int(one[6] or 1)
            for k in range(6):
                if bits >> k & 1:
                    out[top + k, x : x + count] = palette[color]
            x += count
    return out[:h]


def test_sixel_draws_every_pixel_near_its_colour():
    y, x = np.mgrid[:25, :31]
    pixels = np.stack((8 * x, 10 * y, 4 * x + 4 * y), axis=-1).astype(np.uint8)
    shown = decoded(sixel(pixels))
    assert np.abs(shown - pixels / 255.0).max() <= 0.21
    # Dithering keeps the mean.
    assert shown.mean(axis=(0, 1)) == pytest.approx(pixels.mean(axis=(0, 1)) / 255.0, abs=0.02)


def test_png_is_read_as_it_was_written(tmp_path):
    pixels = np.random.default_rng(0).integers(0, 256, (7, 5, 3)).astype(np.uint8)
    (tmp_path / "a.png").write_bytes(png_bytes(pixels))
    read = oiio.ImageBuf(str(tmp_path / "a.png")).get_pixels(oiio.UINT8)
    assert np.array_equal(read, pixels)

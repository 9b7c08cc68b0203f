"""Weaves from images."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fabricusd.errors import FabricError
from fabricusd.weaves import parse_color, parse_weave, read_image
from fabricusd.weaves.color import palette_from_codes
from fabricusd.weaves.image.threads import find_threads
from tests import fuzz

RED, BLUE, GREEN, YELLOW, DARK = (
    (200, 0, 0), (0, 0, 200), (0, 160, 0), (250, 240, 0), (20, 20, 30),
)  # fmt: skip


def save(path: Path, pixels: np.ndarray, kind: str = "uint8", alpha: bool = False) -> Path:
    """Write (h, w) or (h, w, channels) pixels."""
    pixels = np.ascontiguousarray(pixels if pixels.ndim == 3 else pixels[..., None])
    h, w, channels = pixels.shape
    spec = oiio.ImageSpec(w, h, channels, oiio.TypeDesc(kind))
    if alpha:
        spec.alpha_channel = channels - 1
        spec.attribute("oiio:UnassociatedAlpha", 1)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec), out.geterror()
    assert out.write_image(pixels), out.geterror()
    out.close()
    return path


def cloth(cells: np.ndarray, warp: list, weft: list) -> np.ndarray:
    """(picks, ends, 3) picture of the cells (ends, picks), last pick on top."""
    warp_rows, weft_rows = np.array(warp)[:, None], np.array(weft)[None, :]
    return np.where(cells[..., None], warp_rows, weft_rows).swapaxes(0, 1)[::-1].astype(np.uint8)


CELLS = np.array([[1, 1, 0], [0, 1, 1], [0, 0, 1], [1, 0, 0]], bool)  # 4 ends, 3 picks


@pytest.mark.parametrize(
    ("suffix", "kind", "channels"),
    [
        (".png", "uint8", 1), (".png", "uint8", 3), (".png", "uint16", 1), (".tif", "uint8", 3),
        (".tif", "float", 3), (".exr", "half", 3), (".bmp", "uint8", 3), (".tga", "uint8", 3),
        (".ppm", "uint8", 3), (".jpg", "uint8", 3),
    ],
)  # fmt: skip
def test_black_is_warp_on_top_in_any_format(
    tmp_path: Path, suffix: str, kind: str, channels: int
) -> None:
    # Cells of eight pixels, so that a compressed format keeps them black and white.
    grown = np.kron(CELLS, np.ones((8, 8), bool))
    white = {"uint8": 255, "uint16": 65535}.get(kind, 1)
    dtype = {"uint8": np.uint8, "uint16": np.uint16}.get(kind, np.float32)
    pixels = np.where(grown.T[::-1], 0, white).astype(dtype)
    path = save(tmp_path / f"draft{suffix}", np.repeat(pixels[..., None], channels, 2), kind)
    draft = read_image(path)
    assert np.array_equal(draft.weave.cells, grown)
    assert not draft.colored
    assert draft.title == "draft"


def test_the_top_row_is_the_last_pick_and_the_left_column_the_first_end(tmp_path: Path) -> None:
    pixels = np.full((3, 2), 255, np.uint8)
    pixels[0, 1] = 0
    cells = read_image(save(tmp_path / "one.png", pixels)).weave.cells
    assert np.argwhere(cells).tolist() == [[1, 2]]


def test_invert_takes_white_for_the_warp(tmp_path: Path) -> None:
    path = save(tmp_path / "d.png", np.where(CELLS.T[::-1], 255, 0).astype(np.uint8))
    assert np.array_equal(read_image(path, invert=True).weave.cells, CELLS)


def test_transparent_pixels_are_paper(tmp_path: Path) -> None:
    pixels = np.zeros((3, 4, 4), np.uint8)
    pixels[..., 3] = np.where(CELLS.T[::-1], 255, 0)
    draft = read_image(save(tmp_path / "clear.png", pixels, alpha=True))
    assert np.array_equal(draft.weave.cells, CELLS)


def test_a_cloth_of_distinct_warp_and_weft_colours_gives_each_thread_its_own(
    tmp_path: Path,
) -> None:
    warp, weft = [RED, BLUE, RED, BLUE], [GREEN, GREEN, GREEN]
    draft = read_image(save(tmp_path / "c.png", cloth(CELLS, warp, weft)))
    assert np.array_equal(draft.weave.cells, CELLS)
    assert [draft.palette[k] for k in draft.warp_colors] == list(palette_from_codes(warp))
    assert [draft.palette[k] for k in draft.weft_colors] == list(palette_from_codes(weft))
    assert draft.warnings == ()


def test_of_two_colours_the_darker_is_warp_and_the_draft_says_so(tmp_path: Path) -> None:
    path = save(tmp_path / "c.png", cloth(CELLS, [DARK] * 4, [YELLOW] * 3))
    draft = read_image(path)
    assert np.array_equal(draft.weave.cells, CELLS)
    assert "does not say whether #14141e is warp or weft; taken as warp" in draft.warnings[0]
    assert np.array_equal(read_image(path, invert=True).weave.cells, ~CELLS)


@pytest.mark.parametrize("side", ["warp_colors", "weft_colors"])
def test_the_colours_of_one_set_decide_for_both(tmp_path: Path, side: str) -> None:
    path = save(tmp_path / "c.png", cloth(CELLS, [YELLOW] * 4, [DARK] * 3))
    told = {side: [parse_color("#faf000" if side == "warp_colors" else "#14141e")]}
    draft = read_image(path, **told)
    assert np.array_equal(draft.weave.cells, CELLS)
    assert draft.warnings == ()


def test_black_and_white_threads_are_colours_when_asked_for(tmp_path: Path) -> None:
    path = save(tmp_path / "c.png", cloth(CELLS, [(0, 0, 0)] * 4, [(255, 255, 255)] * 3))
    draft = read_image(path, mode="colors")
    assert draft.colored
    assert np.array_equal(draft.weave.cells, CELLS)


def test_a_thread_that_never_comes_up_takes_the_usual_colour(tmp_path: Path) -> None:
    cells = CELLS.copy()
    cells[1] = False
    warp, weft = [RED, RED, RED, BLUE], [GREEN] * 3
    draft = read_image(save(tmp_path / "c.png", cloth(cells, warp, weft)))
    assert draft.palette[draft.warp_colors[1]] == palette_from_codes([RED])[0]
    assert "1 column(s) show no warp; the warp is taken to be #c80000 there" in draft.warnings[0]


@given(
    st.integers(0, 2**20 - 1),
    st.lists(st.integers(0, 2), min_size=5, max_size=5),
    st.lists(st.integers(3, 5), min_size=4, max_size=4),
)
def test_threads_found_without_help_show_the_same_picture(
    bits: int, warp: list[int], weft: list[int]
) -> None:
    cells = np.array([bool(bits >> k & 1) for k in range(20)]).reshape(5, 4)
    shown = np.where(cells, np.array(warp)[:, None], np.array(weft)[None, :]).T.astype(np.uint8)
    colors = np.arange(18, dtype=np.uint8).reshape(6, 3)
    used = np.unique(shown)
    index = np.searchsorted(used, shown).astype(np.uint8)
    try:
        found = find_threads("x", index.copy(), colors[used])
    except FabricError as error:
        # Only a picture of one set, all warp or all weft, cannot be told.
        assert "shows no" in error.problem, error  # noqa: PT017
        return
    again = np.where(found.warp_on_top, found.columns[None, :], found.rows[:, None])
    assert np.array_equal(again, index)


def test_a_jacquard_of_4096_by_4096_is_read_in_bounded_time_and_memory(tmp_path: Path) -> None:
    cells = np.random.default_rng(1).random((4096, 4096)) < 0.5
    path = save(tmp_path / "big.png", np.where(cells.T[::-1], 0, 255).astype(np.uint8))
    read_image(path)  # loads the library
    with fuzz.guarded(seconds=10, megabytes=200):  # measured 0.5 s; its cells are 16 MB
        draft = read_image(path)
    assert np.array_equal(draft.weave.cells, cells)


def test_grey_is_refused_with_its_pixel(tmp_path: Path) -> None:
    pixels = np.zeros((3, 4), np.uint8)
    pixels[2, 1] = 128
    path = save(tmp_path / "grey.png", pixels)
    with pytest.raises(FabricError, match=r"pixel \(1, 2\) is #808080; it must be black or white"):
        read_image(path, mode="black-white")


def test_a_column_of_two_warp_colours_is_refused_with_its_pixel(tmp_path: Path) -> None:
    picture = cloth(CELLS, [RED, BLUE, RED, BLUE], [GREEN] * 3)
    picture[2, 0] = BLUE  # the first pick of the first end, which is red
    path = save(tmp_path / "c.png", picture)
    told = {"warp_colors": [palette_from_codes([RED])[0], palette_from_codes([BLUE])[0]]}
    with pytest.raises(
        FabricError, match=r"pixel \(0, \d\) is #.*its column shows the warp colour"
    ):
        read_image(path, **told)


def test_a_tartan_that_shares_its_colours_is_refused_with_its_pixel(tmp_path: Path) -> None:
    cells = np.tile(parse_weave("twill 2/2").weave.cells, (3, 3))
    order = [RED] * 4 + [BLUE] * 4 + [YELLOW] * 4
    path = save(tmp_path / "tartan.png", cloth(cells, order, order))
    message = r"tartan.png pixel \(\d, \d\) is #.*give the colours of the warp or"
    with pytest.raises(FabricError, match=message):
        read_image(path)


def test_a_photograph_is_refused_with_its_number_of_colours(tmp_path: Path) -> None:
    pixels = np.random.default_rng(3).integers(0, 255, (40, 40, 3)).astype(np.uint8)
    with pytest.raises(FabricError, match=r"has 1\d\d\d colours; it must have at most 64"):
        read_image(save(tmp_path / "p.png", pixels))


def test_a_cloth_of_one_colour_is_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "c.png", np.full((3, 4, 3), RED, np.uint8))
    with pytest.raises(FabricError, match="shows no weft thread"):
        read_image(path)


def test_a_colour_that_the_image_does_not_show_is_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "c.png", cloth(CELLS, [RED] * 4, [GREEN] * 3))
    with pytest.raises(FabricError, match=r"warp colour #ffffff is not in the image; .*#c80000"):
        read_image(path, warp_colors=[(1, 1, 1)])


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"warp_colors": [RED, BLUE], "weft_colors": [GREEN, RED]}, "is #c80000, a colour of both"),
        ({"warp_colors": [RED], "weft_colors": [GREEN]}, "is #0000c8, a colour of neither set"),
    ],
)
def test_a_colour_told_to_both_sets_or_to_none_is_refused(
    tmp_path: Path, told: dict[str, list], message: str
) -> None:
    path = save(tmp_path / "c.png", cloth(CELLS, [RED, BLUE, RED, BLUE], [GREEN] * 3))
    linear = {key: list(palette_from_codes(value)) for key, value in told.items()}
    with pytest.raises(FabricError, match=message):
        read_image(path, **linear)


def test_a_wide_image_is_refused_before_its_pixels_are_read(tmp_path: Path) -> None:
    path = save(tmp_path / "wide.png", np.zeros((1, 16385), np.uint8))
    with pytest.raises(FabricError, match="is 16385 x 1 x 1 pixels; it must be flat, and from 1"):
        read_image(path)


def test_not_a_number_is_refused_with_its_pixel(tmp_path: Path) -> None:
    pixels = np.ones((3, 4, 3), np.float32)
    pixels[1, 2, 0] = np.nan
    with pytest.raises(FabricError, match=r"pixel \(2, 1\) is nan, 1, 1; it must be finite"):
        read_image(save(tmp_path / "n.exr", pixels, "float"))


def test_an_unknown_mode_is_refused() -> None:
    with pytest.raises(FabricError, match="mode is 'grey'; it must be one of auto, black-white"):
        read_image("x.png", mode="grey")


@pytest.mark.parametrize("kind", ["missing", "directory", "empty", "text", "truncated", "no name"])
def test_a_file_that_is_no_image_is_refused_in_one_line(
    tmp_path: Path, kind: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "image.png"
    if kind == "directory":
        path.mkdir()
    elif kind == "empty":
        path.touch()
    elif kind == "text":
        path.write_text("not an image\n" * 50)
    elif kind == "truncated":
        noise = np.random.default_rng(0).integers(0, 2, (200, 200)) * 255
        save(path, noise.astype(np.uint8))
        path.write_bytes(path.read_bytes()[:1500])
    elif kind == "no name":
        path = Path("a\0b.png")
    with pytest.raises(FabricError) as caught:
        read_image(path)
    assert str(caught.value).isprintable()
    assert "image.png" in str(caught.value) or kind == "no name"
    assert capfd.readouterr().err == ""  # libpng would say its own


@pytest.mark.parametrize("byte", [0x07, 0xE9])
def test_a_header_that_is_no_text_is_refused_in_one_line(tmp_path: Path, byte: int) -> None:
    path = save(tmp_path / "image.exr", np.zeros((3, 4, 3), np.float32), "half")
    data = path.read_bytes()
    path.write_bytes(data.replace(b"chlist", bytes([byte]) + b"hlist"))
    with pytest.raises(FabricError, match=r"image\.exr is not an image") as caught:
        read_image(path)
    assert str(caught.value).isprintable()

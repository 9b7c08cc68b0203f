"""Figured weaves: artwork with blurred edges becomes regions, each in its own weave."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.images.files import write_png
from fabricusd.weaves import parse_color, parse_weave
from fabricusd.weaves.figure import Figure, read_figure
from fabricusd.weaves.figure.regions import border_color, figure_color, regions
from fabricusd.weaves.floats import floats

PAPER, RED, BLUE = (240, 232, 215), (150, 30, 40), (30, 50, 110)
OVER = 4
"""Times by which artwork is drawn larger and averaged, which blurs its edges as a drawing
program does."""


def artwork(size: int = 120) -> np.ndarray:
    """(size, size, 3) uint8: a red disc in a blue ring on paper, with blurred edges."""
    y, x = (np.mgrid[0 : size * OVER, 0 : size * OVER] + 0.5) / OVER - size / 2
    radius = np.hypot(x, y) / size
    image = np.full((*radius.shape, 3), PAPER, float)
    image[radius < 0.25] = RED
    image[(radius > 0.35) & (radius < 0.42)] = BLUE
    return image.reshape(size, OVER, size, OVER, 3).mean((1, 3)).round().astype(np.uint8)


@pytest.fixture
def drawn(tmp_path: Path) -> Path:
    write_png(tmp_path / "disc.png", artwork())
    return tmp_path / "disc.png"


def test_the_colours_are_found_in_the_artwork() -> None:
    two = artwork()
    two[(two[..., 2] > 90) & (two[..., 0] < 200)] = PAPER
    ground = border_color(two)
    assert tuple(ground) == PAPER
    assert np.abs(figure_color(two, ground, "art").astype(int) - RED).max() < 12


def test_regions_are_those_of_the_drawing_and_blends_on_edges_are_none() -> None:
    """Violet, the colour of no drawn region, is what the edge of red and blue blends to."""
    art = artwork()
    art[:, 60:][art[:, 60:, 0] > 200] = BLUE  # red now borders blue
    violet = tuple((np.array(RED, int) + BLUE) // 2)
    colors = np.array([PAPER, RED, BLUE, violet], np.uint8)
    found = regions(art, colors, 120, 120)
    shares = np.bincount(found.ravel(), minlength=4) / found.size
    assert shares[1] == pytest.approx(np.pi * 0.25**2, abs=0.01)
    assert shares[3] < 0.002


def test_the_nearest_colour_alone_would_see_the_blend() -> None:
    """The twin of the test before it: without the soft shares the edges become regions."""
    art = artwork()
    art[:, 60:][art[:, 60:, 0] > 200] = BLUE
    violet = tuple((np.array(RED, int) + BLUE) // 2)
    colors = np.array([PAPER, RED, BLUE, violet], float)
    nearest = np.argmin(((art[..., None, :] - colors) ** 2).sum(-1), axis=-1)
    assert (nearest == 3).mean() > 0.002


def test_the_top_of_the_artwork_is_the_last_pick_and_its_left_the_first_end() -> None:
    art = np.full((16, 16, 3), 255, np.uint8)
    art[:8, :8] = 0
    found = regions(art, np.array([(255,) * 3, (0,) * 3], np.uint8), 16, 16)
    assert found[2, 13] == 1
    assert found[13, 13] == found[2, 2] == 0


@pytest.mark.parametrize("size", [40, 120, 360])
def test_each_region_has_its_weave_inside(drawn: Path, size: int) -> None:
    draft = read_figure(drawn, Figure(weaves=[(None, "satin 8")], ends=size))
    cells = draft.weave.cells
    assert cells.shape == (size, size)
    middle, corner = cells[size // 2 - 4 :, size // 2 - 4 :][:8, :8], cells[:8, :8]
    if size > 40:
        assert middle.mean() == pytest.approx(7 / 8)
    assert corner.mean() == pytest.approx(1 / 8)


def test_any_number_of_regions_is_told_by_colour(drawn: Path) -> None:
    weaves = [(parse_color("#961e28"), "satin 5"), (parse_color("#1e326e"), "plain")]
    draft = read_figure(drawn, Figure(weaves=weaves, ground_weave="satin 5 weft"))
    satin = parse_weave("satin 5").weave.cells
    assert np.array_equal(draft.weave.cells[55:65, 55:65], np.tile(satin, (2, 2)))
    assert draft.palette == (parse_color("#961e28"), parse_color("#f0e8d7"))
    assert "#1e326e in plain" in draft.warnings[0]


def test_a_figure_has_its_colour_in_the_warp_and_the_ground_in_the_weft(drawn: Path) -> None:
    draft = read_figure(drawn)
    assert len(draft.palette) == 2
    assert draft.palette[draft.weft_colors[0]] == parse_color("#f0e8d7")


def test_floats_are_bounded_and_reported(drawn: Path) -> None:
    draft = read_figure(drawn)
    assert floats(draft.weave.cells).longest == 7
    assert "warp over up to 7 picks" in draft.warnings[-1]
    short = read_figure(drawn, Figure(longest=4))
    assert floats(short.weave.cells).longest <= 4
    assert "crossings tied to keep them within 4" in short.warnings[-1]


def test_the_repeat_is_whole_and_keeps_the_proportions_of_the_artwork(drawn: Path) -> None:
    draft = read_figure(drawn, Figure(ends=203, pitch_ratio=0.5))
    assert draft.weave.cells.shape == (200, 104)


@pytest.mark.parametrize(
    ("figure", "said"),
    [
        (Figure(weaves=[(None, "satin 8"), (None, "plain")]), "not a colour for each"),
        (Figure(weaves=[(None, "satin 6")]), "weave 'satin 6'"),
        (Figure(weaves=[(parse_color("#f0e8d7"), "plain")]), "of the ground; they must be"),
        (Figure(ends=16384, pitch_ratio=4.0), "would repeat after 16384 x"),
    ],
)
def test_a_figure_that_cannot_be_woven_is_refused(drawn: Path, figure: Figure, said: str) -> None:
    with pytest.raises(FabricError, match=said):
        read_figure(drawn, figure)


def test_artwork_of_one_colour_is_refused(tmp_path: Path) -> None:
    write_png(tmp_path / "flat.png", np.full((8, 8, 3), 90, np.uint8))
    with pytest.raises(FabricError, match="#5a5a5a everywhere"):
        read_figure(tmp_path / "flat.png")


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    (tmp_path / "art.png").write_text("no picture")
    with pytest.raises(FabricError, match=r"art\.png"):
        read_figure(tmp_path / "art.png")

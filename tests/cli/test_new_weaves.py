"""`new`: tartans, stripes and artwork, as a person asks for them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fabricusd.images.files import write_png
from fabricusd.schema import load
from fabricusd.weaves import parse_color
from tests.cli.commands import run


def colors(path: Path, which: str) -> list[tuple[float, float, float]]:
    fabric = load(path)
    return [fabric.thread_list[k].color for k in getattr(fabric, which).sequence]


@pytest.fixture
def art(tmp_path: Path) -> Path:
    pixels = np.full((64, 64, 3), 230, np.uint8)
    pixels[16:48, 16:48] = (120, 20, 30)
    write_png(tmp_path / "art.png", pixels)
    return tmp_path / "art.png"


def test_a_tartan_has_its_sett_in_both_directions_and_is_a_twill(capsys, tmp_path):
    out = tmp_path / "t.usda"
    status, _, err = run(capsys, "new", "--tartan", "B24 W4 B24 R2 K24", "-o", str(out))
    assert status == 0, err
    warp = colors(out, "warp")
    assert warp == colors(out, "weft")
    assert len(warp) == 24 + 2 * (4 + 24 + 2) + 24
    assert load(out).weave.name == "twill 2/2 Z"


def test_a_tartan_may_have_another_weave_palette_and_weft(capsys, tmp_path):
    out = tmp_path / "t.usda"
    status, _, err = run(
        capsys, "new", "--weave", "plain", "--tartan", "B4 R2", "W2 R2",
        "--palette", "B=#0000ff", "-o", str(out),
    )  # fmt: skip
    assert status == 0, err
    assert colors(out, "warp")[0] == (0.0, 0.0, 1.0)
    assert colors(out, "weft")[0] == parse_color("#e0e0e0")
    assert load(out).weave.name == "plain"


def test_stripes_are_in_the_warp_alone(capsys, tmp_path):
    out = tmp_path / "s.usda"
    run(capsys, "new", "--stripes", "...B6 W2", "--weft-color", "#fff", "-o", str(out))
    assert len(colors(out, "warp")) == 8
    assert colors(out, "weft") == [(1.0, 1.0, 1.0)]


def test_artwork_is_woven_in_the_weaves_asked_for(capsys, tmp_path, art):
    out = tmp_path / "f.usda"
    status, _, err = run(
        capsys, "new", "--figure", str(art), "--figure-weave", "satin 5", "--ground-weave",
        "satin 5 weft", "--figure-ends", "80", "-o", str(out),
    )  # fmt: skip
    assert status == 0
    assert "satin 5 step 2 weft" in err
    assert load(out).weave.cells.shape == (80, 80)
    assert load(out).weave.cells[40:45, 40:45].mean() == pytest.approx(0.8)


def test_artwork_with_two_figures_is_told_apart_by_colour(capsys, tmp_path, art):
    out = tmp_path / "f.usda"
    status, _, err = run(
        capsys, "new", "--figure", str(art), "--figure-weave", "#78141e=mod(i + j, 2) == 0",
        "--warp-color", "#fff", "--weft-color", "#000", "-o", str(out),
    )  # fmt: skip
    assert status == 0, err
    assert load(out).weave.cells[28:36, 28:36].mean() == 0.5
    assert colors(out, "warp") == [(1.0, 1.0, 1.0)]


def test_a_drawdown_with_floats_that_no_loom_makes_is_warned_of(capsys, tmp_path):
    pixels = np.kron([[1, 0], [0, 0]], np.ones((20, 20))).astype(np.uint8) * 255
    pixels[20:, ::2] = 255
    write_png(tmp_path / "d.png", pixels[..., None])
    status, _, err = run(capsys, "new", "--image", str(tmp_path / "d.png"))
    assert status == 0
    assert "The floats are long: the warp past all picks and the weft past 20 ends." in err
    assert "--figure" in err


def test_a_drawdown_with_short_floats_is_not_warned_of(capsys, tmp_path):
    pixels = np.kron(np.indices((4, 4)).sum(0) % 2, np.ones((8, 8))) * 255
    write_png(tmp_path / "d.png", pixels.astype(np.uint8)[..., None])
    _, _, err = run(capsys, "new", "--image", str(tmp_path / "d.png"))
    assert "float" not in err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "nothing to make a fabric from"),
        (("--tartan", "B4", "R4", "K4"), "--tartan has 3 threadcounts"),
        (("--tartan", "B4", "--warp-color", "#fff"), "--warp-color cannot be used with --tartan"),
        (("--tartan", "B4 Z9"), "--tartan has the colour 'Z'"),
        (("--stripes", "B4", "--image", "x.png"), "--stripes has colours for a --weave"),
        (("--weave", "plain", "--palette", "B=#fff"), "--palette can only be used with"),
        (
            ("--weave", "plain", "--figure-ends", "9"),
            "--figure-ends can only be used with --figure",
        ),
        (("--preset", "velvet", "--tartan", "B4"), "--tartan cannot be used with --preset"),
        (("--figure", "nowhere.png"), "nowhere.png cannot be read"),
        (("--tartan", "B4", "--invert"), "--invert can only be used with an image"),
    ],
)
def test_options_that_do_not_go_together_are_refused(capsys, tmp_path, arguments, said):
    out = tmp_path / "out.usda"
    status, _, err = run(capsys, "new", *arguments, "-o", str(out))
    assert status == 2
    assert said in err
    assert len(err.splitlines()) == 1
    assert not out.exists()

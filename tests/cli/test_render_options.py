"""`fabricusd render`: frames, names that exist, and numbers that are too large."""

from __future__ import annotations

import pytest

from fabricusd.cli.main import main
from fabricusd.cli.render import parse_frames
from fabricusd.errors import FabricError

FRAMES = {
    "7": (7,),
    "1-3": (1, 2, 3),
    "1-2x0.5": (1, 1.5, 2),
    "-2": (-2,),
    "-3--1": (-3, -2, -1),
    "-1-1": (-1, 0, 1),
    "1, 4,9-10": (1, 4, 9, 10),
}


@pytest.mark.parametrize("text", FRAMES)
def test_frames_are_time_codes(text):
    assert parse_frames(text) == FRAMES[text]


@pytest.mark.parametrize("text", ["", "x", "1-", "3-1", "1-2x0", "inf", "1::3", "1-2-3", "1.2.3"])
def test_frames_that_are_none_are_refused_with_the_text(text):
    with pytest.raises(FabricError, match="--frames is"):
        parse_frames(text)


OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"

REFUSED = {
    # name: (what lies there, arguments, words)
    "a numbered picture that exists": (
        "x.0002.png", ["--frames", "1-2", "--no-clobber"], "x.0002.png exists",
    ),
    "a picture beside it that is a folder": ("x.png/", [], "x.png is a directory"),
    "a name that is too long": ("", ["-o", "x" * 300 + ".exr"], "cannot be written: File name too"),
    "an empty list of frames": ("", ["--frames", ""], "--frames is ''"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_done_is_refused_before_the_work(tmp_path, capsys, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    lies, arguments, words = REFUSED[name]
    (tmp_path / "x.obj").write_text(OBJ)
    if lies.endswith("/"):
        (tmp_path / lies).mkdir()
    elif lies:
        (tmp_path / lies).write_text("kept")
    before = sorted(p.name for p in tmp_path.iterdir())
    out = str(tmp_path / "x.exr")
    size = ["--width", "16384", "--height", "16384"]
    assert main(["render", str(tmp_path / "x.obj"), "-o", out, *size, *arguments]) == 2
    assert words in capsys.readouterr().err
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_a_seed_of_64_bits_is_kept_in_the_picture(tmp_path):
    from fabricusd.images.files import read_exr_layers

    (tmp_path / "x.obj").write_text(OBJ)
    out = tmp_path / "x.exr"
    size = ["--width", "8", "--height", "8", "--spp", "1", "--seed", str(2**40)]
    assert main(["render", str(tmp_path / "x.obj"), "-o", str(out), *size, "-q"]) == 0
    assert read_exr_layers(out)[1]["fabricusd:seed"] == str(2**40)

"""`fit --flat` and `fit --cylinder`: what is missing or contradicts is said in one line."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.images.files import write_png
from fabricusd.srgb import srgb_encode
from tests.cli.commands import run
from tests.measure.flat.pictures import woven

LIGHT = ("--light", "0", "1", "1")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("flat")
    for name, pitch, size in (("wide", 7.3, 160), ("fine", 3.2, 160), ("large", 7.3, 192)):
        codes = srgb_encode(woven("twill 2/1 S", (pitch, pitch), size=size).linear)
        write_png(made / f"{name}.png", np.rint(255 * codes).astype(np.uint8))
    (made / "text.png").write_text("no picture")
    (made / "wraps.json").write_text("{}")
    return made


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "LOBES is missing"),
        (("--flat", "wide.png"), "--light is missing"),
        (("--flat", "wide.png", "--light", "0", "1", "-1"), "--light has z -1"),
        (("--flat", "none.png", *LIGHT), "none.png"),
        (("--flat", "text.png", *LIGHT), "text.png"),
        (("--flat", "fine.png", *LIGHT), "pixels a thread"),
        (("--flat", "wide.png", "large.png", *LIGHT), "--back-light is missing"),
        (
            ("--flat", "wide.png", "large.png", *LIGHT, "--back-light", "0", "0", "-1"),
            "large.png' is 192 x 192 pixels; it must be 160 x 160",
        ),
        (("--flat", "wide.png", "wide.png", "wide.png", *LIGHT), "names 3 photographs"),
        (("--flat", "wide.png", *LIGHT, "--pitch", "7"), "--pitch is '7'"),
        (("--flat", "wide.png", *LIGHT, "--weave", "knot"), "weave 'knot' is not known"),
        (("--flat", "wide.png", *LIGHT, "--page", "page.txt"), "must end in .html"),
        (("--flat", "wide.png", *LIGHT, "-o", "cloth.txt"), "cloth.txt"),
        (("--flat", "wide.png", *LIGHT, "--cloth-width", "0"), "--cloth-width"),
        (("--flat", "wide.png", *LIGHT, "--lean"), "--lean cannot be used with --flat"),
        (("--flat", "wide.png", *LIGHT, "--scheduler", "local"), "--scheduler cannot be used with"),
        (("--flat", "wide.png", "--cylinder", "wide.png", *LIGHT), "cannot be used with"),
        (("--light", "0", "1", "1"), "--light can only be used with --flat"),
        (("--coverage",), "--coverage can only be used with --cylinder"),
        (("--cylinder", "wide.png"), "--setup is missing"),
        (("--cylinder", "wide.png", "--setup", "wraps.json"), "--fabric is missing"),
        (
            ("--cylinder", "wide.png", "--setup", "wraps.json", "--fabric", "linen_plain"),
            "no 'camera'",
        ),
    ],
    ids=lambda value: " ".join(value)[:60] if isinstance(value, tuple) else "",
)
def test_a_fault_is_one_line_and_nothing_is_written(capsys, monkeypatch, folder, arguments, words):
    monkeypatch.chdir(folder)
    before = sorted(folder.iterdir())
    status, out, error = run(capsys, "fit", *arguments)
    assert status == 2
    assert out == ""
    assert words in error
    assert error.count("\n") == 1
    assert sorted(folder.iterdir()) == before


def test_a_dry_run_prints_weave_and_pitch(capsys, monkeypatch, folder):
    monkeypatch.chdir(folder)
    status, out, _ = run(capsys, "fit", "--flat", "wide.png", *LIGHT, "-n")
    assert status == 0
    assert out.startswith("twill 2/1 S, 7.3 x 7.3")

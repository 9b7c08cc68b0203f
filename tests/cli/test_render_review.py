"""`render`: reviews without hand-written USD, usdrecord's spellings, denoising."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from fabricusd.cli.render import parse_frames
from fabricusd.images.files import read_exr_layers, read_image, write_png
from tests.cli.commands import run

OBJ = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"
SMALL = ("--width", "16", "--height", "16", "--spp", "4", "--fabric", "linen_plain")


@pytest.fixture
def square(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.obj").write_text(OBJ)
    return tmp_path


def rendered(capsys, *arguments):
    """(layers, metadata) of the EXR `x.exr` that a render wrote."""
    status, _, err = run(capsys, "render", "x.obj", "-o", "x.exr", "--units", "m", *arguments)
    assert status == 0, err
    return read_exr_layers("x.exr")


def test_the_picture_may_be_named_after_the_scene_as_in_usdrecord(capsys, square):
    status, _, err = run(capsys, "render", "x.obj", "x.png", *SMALL)
    assert status == 0, err
    assert (square / "x.png").exists()
    status, _, err = run(capsys, "render", "x.obj", "x.png", "-o", "y.png", *SMALL)
    assert status == 2
    assert "-o names a second picture, 'y.png'" in err
    status, _, err = run(capsys, "render", "x.obj", *SMALL)
    assert status == 2
    assert "OUT is missing" in err


def test_usdrecord_s_spellings_are_understood(capsys, square):
    status, _, err = run(
        capsys, "render", "x.obj", "x.exr", "-w", "32", "-c", "low", "-f", "1:2", "--spp", "1",
        "--fabric", "linen_plain",
    )  # fmt: skip
    assert status == 0, err
    layers, _ = read_exr_layers("x.0002.exr")
    # The height follows from the width.
    assert layers["beauty"].shape[:2] == (18, 32)
    assert parse_frames("1:10x3") == parse_frames("1-10x3")


def test_an_orbit_is_so_many_pictures_from_around(capsys, square):
    status, _, err = run(
        capsys, "render", "x.obj", "turn.png", *SMALL, "--studio", "--frame", "/", "--orbit", "3"
    )
    assert status == 0, err
    pictures = [read_image(f"turn.000{k}.png") for k in (1, 2, 3)]
    assert not (square / "turn.0004.png").exists()
    assert np.abs(pictures[0] - pictures[1]).max() > 0.02
    status, _, err = run(
        capsys, "render", "x.obj", "t.png", *SMALL, "--orbit", "3", "--frames", "1-2"
    )
    assert status == 2
    assert "orbit cannot be had with frames" in err


def test_a_background_is_seen_where_nothing_is_and_lights_nothing(capsys, square):
    write_png(square / "sky.png", np.full((4, 8, 3), 188, np.uint8))
    sky = ("--dome", "sky.png", *SMALL)
    seen, _ = rendered(capsys, *sky)
    laid, _ = rendered(capsys, *sky, "--background", "1,0,0")
    lit, _ = rendered(capsys, *SMALL, "--background", "0,0,1")
    assert lit["beauty"][0, 0] == pytest.approx([0, 0, 1, 1], abs=1e-5)
    corner, middle = laid["beauty"][0, 0], laid["beauty"][8, 8]
    assert corner == pytest.approx([1, 0, 0, 1], abs=1e-5)
    assert seen["beauty"][0, 0, 2] > 0.1
    # Linen has gaps, through which the background is seen; what the cloth returns is the same.
    assert middle[1] <= seen["beauty"][8, 8, 1] + 1e-3
    assert middle[1] > 0.01


def test_quick_and_final_are_settings_that_options_override(capsys, square):
    _, metadata = rendered(capsys, "--quick", "--width", "8", "--fabric", "linen_plain")
    assert metadata["fabricusd:samples"] == 16
    _, metadata = rendered(
        capsys, "--quick", "--spp", "2", "--width", "8", "--fabric", "linen_plain"
    )
    assert metadata["fabricusd:samples"] == 2
    run(
        capsys, "render", "x.obj", "-o", "f.exr", "--final", "--spp", "64", "--width", "8",
        "--fabric", "linen_plain",
    )  # fmt: skip
    _, metadata = read_exr_layers("f.exr")
    assert metadata["fabricusd:samples"] == 64
    assert metadata["fabricusd:noise"] == pytest.approx(0.02)


def test_denoising_removes_noise_and_keeps_the_noisy_picture(capsys, square):
    pytest.importorskip("pyoidn")
    view = ("--width", "48", "--height", "48", "--fabric", "linen_plain", "--studio", "--level",
            "far")  # fmt: skip
    layers, _ = rendered(capsys, *view, "--spp", "4", "--denoise")
    shown = read_image("x.png")
    truth, _ = rendered(capsys, *view, "--spp", "512", "--seed", "7")
    exact = truth["beauty"][..., :3]

    def error(picture: np.ndarray) -> float:
        return float(np.mean((picture - exact) ** 2 / (exact**2 + 0.01)))

    noisy, smooth = layers["beauty"][..., :3], layers["denoised"]
    assert error(smooth) < 0.5 * error(noisy)
    plain, _ = rendered(capsys, *view, "--spp", "4")
    assert np.array_equal(plain["beauty"], layers["beauty"])
    # The PNG shows the denoised layer: below 0.8 the view changes nothing.
    dark = (smooth < 0.7).all(axis=-1)
    assert np.abs(shown - smooth)[dark].max() < 0.01


def test_denoising_without_the_library_says_what_to_install(capsys, square, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    status, _, err = run(capsys, "render", "x.obj", "x.png", *SMALL, "--denoise")
    assert status == 2
    assert "--denoise needs Open Image Denoise; install it with: pip install 'fabricusd[deno" in err
    assert not (square / "x.png").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--dome", "nowhere.exr"), "nowhere.exr"),
        (("--background", "blue-ish"), "--background is 'blue-ish'; it must be #rrggbb"),
        (("--eye", "1,2"), "--eye is '1,2'; it must be three numbers of metres"),
        (("--look-at", "a,b,c"), "--look-at is 'a,b,c'; it must be three numbers"),
        (("--frame", "Coat"), "--frame 'Coat' is no mesh of the scene"),
    ],
)
def test_a_slip_is_refused_in_one_line(capsys, square, arguments, said):
    status, _, err = run(capsys, "render", "x.obj", "x.png", *SMALL, "-q", *arguments)
    assert status == 2
    assert said in err
    assert len(err.splitlines()) == 1
    assert not (square / "x.png").exists()

"""Every number of every command and of the Python API: out of its range, it is refused at once."""

from __future__ import annotations

import argparse
import time

import numpy as np
import pytest

from fabricusd.cli.main import COMMANDS, build_parser, main
from fabricusd.errors import FabricError
from fabricusd.ranges import MOST_PIXELS, RANGES
from fabricusd.reference.render import render, render_scene
from fabricusd.run.workers import worker_count
from fabricusd.scene.scene import Scene

OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"

ODD = ("nan", "inf", "1e308", "1e400", "9" * 400, "", " ", "x", "1,5", "0x10", "٣x", "--", "-inf")
"""No number of any option. `-inf` and `--` are taken for options, and refused as such."""

OPTIONS = {
    ("render", "--width"): ("0", "-1", "65537", "1.5"),
    ("render", "--height"): ("0", "-1", "65537", "1.5"),
    ("render", "--spp"): ("0", "-1", "65537", "1e3"),
    ("render", "--noise"): ("0", "-1", "10.5"),
    ("render", "--max-bounces"): ("-1", "1025", "1e30", "1" + "0" * 30),
    ("render", "--max-translucent"): ("-1", "1025", "1.5"),
    ("render", "--max-error"): ("0", "-1", "1001"),
    ("render", "--exposure"): ("100000", "-101"),
    ("render", "--seed"): (str(2**63), "1.5"),
    ("render", "--workers"): ("0", "-1", "1025", "100000"),
    ("render", "--dome-rotation"): ("361", "-361"),
    ("render", "--orbit"): ("0", "-1", "3601", "1.5"),
    ("bake", "--workers"): ("0", "-1", "1025", "100000"),
    ("new", "--ends-per-cm"): ("0", "-3", "10001"),
    ("new", "--picks-per-cm"): ("0", "-3", "10001"),
    ("new", "--thickness"): ("-0.1", "1001"),
    ("dress", "--grain"): ("361", "-361"),
    ("dress", "--scale"): ("-1", "1e7"),
    ("new", "--ends-per-inch"): ("0", "-3", "25401"),
    ("new", "--picks-per-inch"): ("0", "-3", "25401"),
    ("new", "--packing"): ("0", "-0.1", "1.1"),
    ("new", "--figure-ends"): ("0", "-1", "16385", "1.5"),
    ("new", "--figure-picks"): ("0", "-1", "16385", "1.5"),
    ("new", "--longest-float"): ("1", "-1", "16385", "1.5"),
    ("compare", "--max-flip"): ("-0.1", "1001"),
    ("compare", "--max-error"): ("-0.1", "1001"),
    ("compare", "--significance"): ("0", "-0.1", "0.6"),
    ("sides", "--paths"): ("0", "63", "1048577", "1.5"),
    ("material", "--lobes"): ("0", "-1", "7", "1.5"),
    ("material", "--max-error"): ("0", "-1", "1001"),
    ("measure", "--seed"): (str(2**63), "1.5"),
    ("measure", "--workers"): ("0", "-1", "1025", "100000"),
    ("fit", "--seed"): (str(2**63), "1.5"),
    ("fit", "--spp"): ("0", "-1", "65537", "1e3"),
    ("fit", "--view-angle"): ("0", "151", "-1"),
    ("fit", "--cloth-width"): ("0", "-1", "100001"),
    ("fit", "--card-reflectance"): ("0", "1.01", "-1"),
    ("fit", "--workers"): ("0", "-1", "1025", "100000"),
    ("preview", "--port"): ("-1", "65536", "1.5"),
    ("preview", "--size"): ("0", "15", "4097", "1.5"),
    ("preview", "--samples"): ("0", "-1", "1025", "1.5"),
    ("preview", "--exposure"): ("100000", "-101"),
}

ARGUMENTS = {
    "render": ["x.obj", "-o", "out.exr"],
    "bake": ["x.obj", "--fabric", "velvet", "-o", "out"],
    "dress": ["x.obj", "--fabric", "velvet", "-o", "out.usda"],
    "new": ["--weave", "plain", "-o", "out.usda"],
    "compare": ["a.png", "b.png", "-o", "out.png"],
    "sides": ["linen_plain", "-o", "out.usda"],
    "material": ["baked", "--surface", "lobes"],
    "preview": ["linen_plain", "-o", "out.png"],
    "measure": ["shoot", "-o", "out.usda"],
    "fit": ["lobes.csv", "-o", "out.usda"],
}

TEXTS = {
    # (command, option, value): what the line must hold
    ("render", "--frames", "1-200000"): "at most 100000 frames",
    ("render", "--frames", "1-99999,1-99999"): "at most 100000 frames",
    ("render", "--frames", "9" * 400): "from -1000000000 to 1000000000",
    ("render", "--frames", "1e308"): "write it as in 7, 1-10",
    ("render", "--frames", "1-2x0"): "with a step above 0",
    ("render", "--frames", "nan"): "write it as in 7, 1-10",
    ("new", "--warp-color", "0*#fff"): "from 1 to 16384",
    ("new", "--warp-color", "99999999*#fff"): "from 1 to 16384",
    ("new", "--warp-color", "nan,0,0"): "--warp-color",
    ("new", "--weft-color", "1e308,0,0"): "--weft-color",
    ("new", "--weft-color", "-1,0,0"): "--weft-color",
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.obj").write_text(OBJ)
    return tmp_path


def refusal(capsys, folder, arguments):
    """The one line, of a command that is refused at once and writes nothing."""
    before = sorted(folder.iterdir())
    began = time.process_time()
    try:
        status = main(arguments)
    except SystemExit as stop:
        status = stop.code
    assert time.process_time() - began < 1
    err = capsys.readouterr().err
    assert status == 2, err
    assert len(err.splitlines()) == 1
    assert "internal error" not in err
    assert sorted(folder.iterdir()) == before
    return err


@pytest.mark.parametrize(("command", "option"), OPTIONS)
def test_a_number_out_of_range_is_refused_with_option_value_and_range(
    capsys, folder, command, option
):
    differs = command == "compare" and option.startswith("--max-")
    setting = "difference" if differs else option[2:].replace("-", "_")
    for value in (*OPTIONS[command, option], *ODD):
        line = refusal(capsys, folder, [command, *ARGUMENTS[command], option, value])
        assert option in line
        if value not in ("-inf", "--"):
            assert str(RANGES[setting]) in line
            assert f"is '{value.strip()[:20]}" in line


@pytest.mark.parametrize(("command", "option", "value"), TEXTS)
def test_a_number_within_a_text_is_refused_with_option_value_and_range(
    capsys, folder, command, option, value
):
    line = refusal(capsys, folder, [command, *ARGUMENTS[command], option, value])
    assert option in line
    assert TEXTS[command, option, value] in line


def test_a_picture_of_too_many_pixels_is_refused(capsys, folder):
    size = ["--width", "60000", "--height", "60000"]
    line = refusal(capsys, folder, ["render", *ARGUMENTS["render"], *size])
    assert f"60000 x 60000 pixels; it must have at most {MOST_PIXELS}" in line


def test_the_table_has_every_option_that_takes_a_number():
    """By their `type`: whoever adds a number adds its row, and a range."""
    found = set()
    for command in COMMANDS:
        parsers = build_parser(command)._subparsers._group_actions[0].choices
        for action in parsers[command]._actions:
            if action.type is not None:
                found |= {
                    (command, option) for option in action.option_strings if option[:2] == "--"
                }
    assert found - OTHERS == set(OPTIONS)


OTHERS = {
    *(("bake", option) for option in ("--resolution", "--texels-per-thread", "--max-error")),
    ("render", "--imageWidth"),
    ("preview", "--light"),
    ("fit", "--light"),
    ("fit", "--back-light"),
}
"""Options with a `type` whose values `tests/bake` judges, another name of one above, and those of
several numbers, which `test_preview` and `test_fit_photographs` judge."""


BOUNDS = {
    "width": (1, 65536), "height": (1, 65536), "spp": (1, 65536), "noise": (1e-9, 10),
    "max_bounces": (0, 1024), "max_translucent": (0, 1024), "exposure": (-100, 100),
    "seed": (-(2**63), 2**63 - 1),
    "workers": (1, 1024), "max_error": (1e-9, 1000), "thickness": (0, 1000),
}  # fmt: skip


@pytest.mark.parametrize("setting", BOUNDS)
def test_a_range_holds_its_ends_and_nothing_beyond(setting):
    low, high = BOUNDS[setting]
    wanted = RANGES[setting]
    assert low in wanted
    assert high in wanted
    assert low - 1 not in wanted
    assert high + max(1, high // 1000) not in wanted
    for odd in (float("nan"), float("inf"), -float("inf"), None, "1", True, 10**400, 1j, [1]):
        assert odd not in wanted


@pytest.mark.parametrize("number", [np.int32(8), np.int64(8)])
def test_numbers_of_numpy_are_numbers(number):
    for setting in ("width", "workers", "noise", "exposure"):
        assert number in RANGES[setting]
    assert np.float32(0.5) in RANGES["noise"]
    assert np.float32(2) not in RANGES["width"]


IN_PYTHON = {
    "width": (0, 1.5, "8", None, float("nan")),
    "height": (0, 65537),
    "spp": (0, float("nan"), 16.0),
    "noise": (0, float("nan"), "x"),
    "max_bounces": (-1, 1e30, 10**30, None),
    "max_translucent": (-1, 1e30, 10**30, True),
    "seed": (2**63, 0.5),
    "workers": (0, 100000, float("inf")),
}


@pytest.mark.parametrize("setting", IN_PYTHON)
def test_the_python_api_refuses_the_same_before_it_reads(tmp_path, setting):
    for value in IN_PYTHON[setting]:
        for call in (
            lambda value=value: render("nowhere.usda", tmp_path / "x.exr", **{setting: value}),
            lambda value=value: render_scene(
                Scene(meshes=[], materials=[]), **{"width": 8, "height": 8, setting: value}
            ),
        ):
            with pytest.raises(FabricError, match=f"^{setting} is .*; it must be a?.*from|above"):
                call()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("frames", [(float("nan"),), (float("inf"),), (1, 2, 1e10), ("x",)])
def test_frames_in_python_are_numbers(tmp_path, frames):
    with pytest.raises(FabricError, match=r"^frames is .*; it must be from -1000000000 to"):
        render("nowhere.usda", tmp_path / "x.exr", frames=frames)


@pytest.mark.parametrize("exposure", [float("nan"), 1e5, "x"])
def test_exposure_in_python_is_a_number_of_stops(tmp_path, exposure):
    with pytest.raises(FabricError, match=r"^exposure is .*from -100 to 100 stops"):
        render("nowhere.usda", tmp_path / "x.exr", exposure=exposure)


def test_so_many_workers_are_refused_where_they_are_counted():
    assert worker_count(1024) == 1024
    assert worker_count(None) >= 1
    with pytest.raises(FabricError, match="workers is 100000; it must be a whole number from 1 to"):
        worker_count(100000)


def test_a_camera_of_any_exposure_makes_a_picture():
    from fabricusd.images.view import encode

    for stops in (1e5, -1e5, 1e308, float("inf"), -float("inf")):
        code = encode(np.array([[[0.5, 3e38, 0.0]]], np.float32), stops)
        assert code.tolist() == ([[[255, 255, 255]]] if stops > 0 else [[[0, 0, 0]]])


def test_options_are_described_with_a_type_that_argparse_can_name():
    parser = argparse.ArgumentParser()
    from fabricusd.cli.arguments.number import number

    parser.add_argument("--n", type=number("spp"))
    assert parser.parse_args(["--n", "16"]).n == 16

"""Numbers out of range are refused before any work, by `bake` and its dry run alike."""

from __future__ import annotations

import math
from contextlib import ExitStack
from types import SimpleNamespace

import numpy as np
import pytest

from fabricusd.bake import bake as module
from fabricusd.bake.bake import bake, plan
from fabricusd.bake.job import Settings
from fabricusd.bake.ranges import check_settings
from fabricusd.bake.texels.light import unit_light
from fabricusd.bake.work.lock import locked
from fabricusd.cli.main import main
from fabricusd.errors import FabricError
from tests.bake.meshes import write_quad

COMMANDS = [
    (["--light", "nan,nan,1"], "--light nan,nan,1.0 is not a direction"),
    (["--light", "0,0,inf"], "three finite numbers"),
    (["--light", "0,0,0"], "is not above the cloth"),
    (["--light", "1e308,0,1"], "is not above the cloth"),
    (["--light=0,0,-1"], "is not above the cloth"),
    (["--resolution", "0"], "--resolution is 0; it must be a power of two from 64"),
    (["--resolution", "-64"], "--resolution is -64"),
    (["--resolution", "65536"], "--resolution is 65536"),
    (["--texels-per-thread", "0"], "--texels-per-thread is 0.0; it must be a number above 0"),
    (["--texels-per-thread", "nan"], "--texels-per-thread is nan"),
    (["--texels-per-thread", "inf"], "--texels-per-thread is inf"),
    (["--texels-per-thread", "1e308"], "bake fewer threads"),
    (["--max-error", "nan"], "--max-error is nan"),
    (["--max-error", "inf"], "--max-error is inf"),
    (["--max-error", "0"], "--max-error is 0"),
    (["--btf", "ubo2"], "--btf 'ubo2' is unknown"),
    (["--maps", "colour"], "map 'colour' is unknown"),
]


@pytest.mark.parametrize("dry", [[], ["-n"]])
@pytest.mark.parametrize(("words", "said"), COMMANDS)
def test_the_command_refuses_in_one_line(tmp_path, capsys, monkeypatch, words, said, dry):
    scene = write_quad(tmp_path / "square.obj")
    monkeypatch.setattr(module, "_bake", lambda *_: pytest.fail("work was begun"))
    out = tmp_path / "out"
    given = ["bake", str(scene), "--fabric", "linen_plain", "-o", str(out), *words, *dry]
    assert main(given) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_a_dry_run_refuses_overlaps_and_folders_that_cannot_be(tmp_path):
    twice = write_quad(tmp_path / "twice.obj", np.array([[0, 0], [1, 0], [1, 1], [1, 0]]))
    settings = Settings(resolution=64)
    with pytest.raises(FabricError, match="overlap"):
        plan(twice, settings, fabric="linen_plain", out=tmp_path / "out")
    assert not list(tmp_path.glob("*.png"))
    square = write_quad(tmp_path / "square.obj")
    for out, words in ((square, "is a file"), (square / "below", "cannot be created")):
        with pytest.raises(FabricError, match=words):
            plan(square, settings, fabric="linen_plain", out=out)


def too_fine(monkeypatch, held, out):
    monkeypatch.setattr("fabricusd.bake.btf.matrix.LARGEST", 100)
    return {"btf": ("ubo",)}, "has a repeat of"


def without_space(monkeypatch, held, out):
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=1000))
    return {}, "of working space"


def in_use(monkeypatch, held, out):
    out.mkdir()
    held.enter_context(locked(out))
    return {}, "is being written by process"


@pytest.mark.parametrize("prevent", [too_fine, without_space, in_use])
def test_a_dry_run_refuses_what_a_bake_refuses(tmp_path, monkeypatch, prevent):
    square, out = write_quad(tmp_path / "square.obj"), tmp_path / "out"
    with ExitStack() as held:
        change, words = prevent(monkeypatch, held, out)
        settings = Settings(resolution=64, maps=("opacity",), **change)
        for refused in (plan, bake):
            with pytest.raises(FabricError, match=words):
                refused(square, settings=settings, fabric="linen_plain", out=out)
    assert not list(tmp_path.glob("out/*.exr"))


def test_a_dry_run_needs_no_folder(tmp_path, capsys):
    square = write_quad(tmp_path / "square.obj")
    assert main(["bake", str(square), "--fabric", "linen_plain", "-n"]) == 0
    assert "texels per thread" in capsys.readouterr().out
    assert main(["bake", str(square), "--fabric", "linen_plain"]) == 2
    assert "needs a SCENE and -o DIR" in capsys.readouterr().err


@pytest.mark.parametrize(
    "change",
    [
        {"resolution": 0}, {"resolution": 1000}, {"resolution": 256.0}, {"resolution": True},
        {"texels_per_thread": -1.0}, {"texels_per_thread": math.nan},
        {"max_error": -1.0}, {"max_error": math.inf}, {"max_error": "1"},
        {"light": (0.0, 0.0, math.nan)}, {"light": (0.0, 1.0)}, {"light": ("0", "0", "1")},
        {"light": (10**400, 0, 1)}, {"margin": -1}, {"margin": 1e9}, {"margin": 2.5},
        {"maps": ()}, {"level": "far"}, {"shadow": "none"}, {"unwrap": "w"}, {"btf": ("a",)},
        {"file_format": "jpg"},
    ],
)  # fmt: skip
def test_settings_out_of_range_are_refused_in_python_as_well(tmp_path, change):
    with pytest.raises(FabricError, match=r"must be|names no map"):
        check_settings(Settings(**change))
    square = write_quad(tmp_path / "square.obj")
    with pytest.raises(FabricError):
        bake(square, tmp_path / "out", Settings(**change), fabric="linen_plain")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("size", [1e-300, 1e-160, 1.0, 1e200, 1e308])
def test_the_length_of_a_light_does_not_matter(size):
    assert np.allclose(unit_light((0.6 * size, 0.0, 0.8 * size)), (0.6, 0.0, 0.8), atol=1e-15)


def test_uvs_far_out_are_refused_at_once(tmp_path):
    for far in (1e6, 1e9, 1e18, 1e300):
        scene = write_quad(tmp_path / "far.obj", np.array([[0, 0], [far, 0], [far, far], [0, far]]))
        with pytest.raises(FabricError, match=r"tiles 1001 to 1109|beyond 1e\+09"):
            plan(scene, Settings(resolution=64, udim=True), fabric="linen_plain")

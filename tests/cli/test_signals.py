"""Signals to the whole program: a picture is kept, and nothing half-written stays."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fabricusd.fabric import ThreadSet, Weave
from fabricusd.images.files import read_exr_layers
from fabricusd.schema import load, save
from fabricusd.stop import SIGNALS
from tests.appearance.presets import often

ROOT = str(Path(__file__).resolve().parents[2])
OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"
LONG = ["x.obj", "-o", "x.exr", "--width", "64", "--height", "64", "--spp", "65536"]

RENDER = """
import sys
import fabricusd.reference as reference
from fabricusd.cli.main import main

def told(*given, progress=None, render=reference.render, **named):
    said = []

    def say(share, seconds):
        if not said:
            said.append(print("sampling", flush=True))
        if progress is not None:
            progress(share, seconds)

    return render(*given, progress=say, **named)

reference.render = told
sys.exit(main(["render", *sys.argv[1:]]))
"""

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="signals as POSIX has them")


def environment():
    return {**os.environ, "PYTHONPATH": ROOT}


def defaults() -> None:
    """What runs in the background of a script is started with some signals ignored."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL)


def begin(folder, *wrapper: str) -> subprocess.Popen:
    """`render`, once it takes samples."""
    (folder / "x.obj").write_text(OBJ)
    return started([*wrapper, sys.executable, "-c", RENDER, *LONG], folder, "sampling")


def started(command: list[str], folder: Path, word: str) -> subprocess.Popen:
    """A process that has printed `word`."""
    process = subprocess.Popen(
        command, cwd=folder, env=environment(), preexec_fn=defaults,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    if process.stdout.readline() != f"{word}\n":
        pytest.fail(process.communicate()[1])
    return process


def end(process, wanted: int) -> str:
    _, err = process.communicate(timeout=120)
    assert process.returncode == wanted, err
    return err


def require_picture(folder):
    assert read_exr_layers(folder / "x.exr")[1]["fabricusd:complete"] == 0
    assert sorted(p.name for p in folder.iterdir()) == ["x.exr", "x.obj", "x.png"]


@pytest.mark.parametrize("number", SIGNALS)
def test_a_picture_is_kept_by_every_signal_that_asks_for_an_end(tmp_path, number):
    process = begin(tmp_path)
    process.send_signal(number)
    assert "interrupted; the samples taken so far are kept" in end(process, 130)
    require_picture(tmp_path)


def test_under_nohup_the_terminals_end_is_none(tmp_path):
    process = begin(tmp_path, "nohup")
    process.send_signal(signal.SIGHUP)
    time.sleep(0.3)
    assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    assert "interrupted; the samples taken so far are kept" in end(process, 130)
    require_picture(tmp_path)


# The child becomes another program at once.
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_terminal_that_is_closed_does_not_cost_the_picture(tmp_path):
    """With the bar of a terminal, which cannot be written any more."""
    import pty

    (tmp_path / "x.obj").write_text(OBJ)
    child, terminal = pty.fork()
    if child == 0:
        defaults()
        os.chdir(tmp_path)
        os.execve(sys.executable, [sys.executable, "-c", RENDER, *LONG], environment())
    seen = b""
    # With its line end: until that is out the process is still printing.
    while b"sampling\r\n" not in seen:
        seen += os.read(terminal, 4096)
    os.close(terminal)
    deadline = time.monotonic() + 60
    while os.waitpid(child, os.WNOHANG) == (0, 0):
        if time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            pytest.fail("goes on without its terminal")
        time.sleep(0.05)
    require_picture(tmp_path)


WRITING = """
import sys, time
from contextlib import contextmanager
import fabricusd.schema.write as module
from fabricusd.cli.main import main

@contextmanager
def held(path, whole=module.whole_file, **named):
    with whole(path, **named) as temporary:
        temporary.write_text("half")
        print("writing", flush=True)
        time.sleep(60)
        yield temporary

module.whole_file = held
sys.exit(main(["new", "--preset", "velvet", "-o", "velvet.usda"]))
"""


@pytest.mark.parametrize("number", SIGNALS)
def test_a_layer_that_is_being_written_stays_as_it_was(tmp_path, number):
    (tmp_path / "velvet.usda").write_text("old")
    process = started([sys.executable, "-c", WRITING], tmp_path, "writing")
    assert len(list(tmp_path.iterdir())) == 2
    process.send_signal(number)
    assert end(process, 130) == "fabricusd: interrupted\n"
    assert (tmp_path / "velvet.usda").read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


TABLES = """
import sys
from fabricusd.cli.main import main
from fabricusd.steps import watched

def say(name, total, done):
    if name.startswith("horizon table") and 0 < done < total:
        print("table" if done == 1 else f"{done} of {total}", flush=True)

with watched(listener=say):
    sys.exit(main(["render", *sys.argv[1:]]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("number", often(SIGNALS, SIGNALS[:1]))
@pytest.mark.parametrize("worn", ["published", "nearest"])
def test_the_tables_of_a_large_repeat_are_broken_off(number, worn, tmp_path):
    i, j = np.mgrid[0:240, 0:240]
    figure = np.hypot(i - 120, j - 120) < 80 + 30 * np.sin(5 * np.arctan2(j - 120, i - 120))
    satin = (5 * i + j) % 8 == 0
    # No other run of this test has left the table in the cache.
    density = 4000 + 100 * np.random.default_rng().random()
    damask = replace(
        load(f"silk_crepe_de_chine{{appearance={worn}}}"),
        weave=Weave(np.where(figure, ~satin, satin)),
        warp=ThreadSet(sequence=(0,), density=density),
    )
    save(damask, tmp_path / "damask.usda")
    (tmp_path / "x.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n"
    )
    command = [
        sys.executable, "-c", TABLES, "x.obj", "--units", "m", "--fabric", "damask.usda", "-o",
        "x.exr", "--width", "64", "--height", "64", "--level", "weave", "--spp", "4",
    ]  # fmt: skip
    process = started(command, tmp_path, "table")
    process.send_signal(number)
    said, err = process.communicate(timeout=120)
    assert process.returncode == 130, err
    assert "interrupted" in err
    for done, _, total in map(str.split, said.splitlines()):
        assert int(done) < int(total) - 1
    # Pixels that look past the cloth may have been sampled by then, and are kept.
    if (tmp_path / "x.exr").exists():
        assert read_exr_layers(tmp_path / "x.exr")[1]["fabricusd:complete"] == 0
    left = {p.name for p in tmp_path.iterdir()} - {"x.exr", "x.png"}
    assert left == {"damask.usda", "x.obj"}

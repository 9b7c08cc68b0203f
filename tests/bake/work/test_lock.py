"""One writer a folder, and nothing left of one that was killed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings
from fabricusd.bake.work.lock import HOLDER, LOCK, locked, refuse_locked
from fabricusd.cli.main import main
from fabricusd.errors import FabricError
from tests.bake.meshes import write_quad
from tests.bake.work.killed import leave_half_written

ROOT = Path(__file__).resolve().parents[3]

HOLDING = """
import sys, time
from pathlib import Path
from fabricusd.bake.work.lock import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600)
"""


@pytest.fixture
def holder(tmp_path):
    """A process that holds the lock of a folder, and the folder."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDING, str(tmp_path)], stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == b"held\n"
    yield process, tmp_path
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_second_bake_is_refused_and_told_who_holds_the_folder(holder, tmp_path, capsys):
    process, folder = holder
    scene = write_quad(tmp_path / "square.obj")
    state = folder / ".bake"
    state.mkdir()
    (state / "key").write_text("of the first bake")
    words = ["bake", str(scene), "--fabric", "linen_plain", "--resolution", "64", "-o", str(folder)]
    assert main(words) == 2
    said = capsys.readouterr().err
    assert f"is being written by process {process.pid} on " in said
    assert said.count("\n") == 1
    assert (state / "key").read_text() == "of the first bake"


def test_a_look_is_not_written_of_a_bake_that_is_not_done(holder):
    with pytest.raises(FabricError, match="is being written by process"):
        refuse_locked(holder[1])


def test_the_lock_of_a_killed_process_stops_nobody(holder):
    process, folder = holder
    process.kill()
    process.wait()
    assert (folder / LOCK).is_file()
    with locked(folder):
        assert str(os.getpid()) in (folder / HOLDER).read_text()
    assert not list(folder.iterdir())


def test_two_threads_of_a_process_do_not_share_a_lock(tmp_path):
    with locked(tmp_path), pytest.raises(FabricError, match="is being written"), locked(tmp_path):
        pass
    with pytest.raises(ZeroDivisionError), locked(tmp_path):
        raise ZeroDivisionError
    with locked(tmp_path):
        pass
    assert not list(tmp_path.iterdir())


def test_links_in_place_of_its_files_are_not_followed(tmp_path):
    outside = tmp_path / "outside"
    outside.write_text("mine")
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / HOLDER).symlink_to(outside)
    with locked(folder):
        pass
    (folder / LOCK).symlink_to(outside)
    with pytest.raises(FabricError, match="cannot be written"), locked(folder):
        pass
    assert outside.read_text() == "mine"


@pytest.mark.parametrize("said", [b"", b"\xff", b"[1]", b'{"process": "x"}'])
def test_a_damaged_note_of_the_holder_is_no_traceback(tmp_path, said):
    with locked(tmp_path):
        (tmp_path / HOLDER).write_bytes(said)
        with pytest.raises(FabricError, match="by another process"), locked(tmp_path):
            pass


def test_what_a_kill_left_half_written_is_removed_by_the_next_bake(tmp_path):
    scene = write_quad(tmp_path / "square.obj")
    out = tmp_path / "out"
    (out / "report").mkdir(parents=True)
    leave_half_written(out / "x.exr", out / "report" / "x.png")
    settings = Settings(resolution=64, maps=("opacity",))
    bake(scene, out, settings, fabric="linen_plain")
    assert not list(out.glob(".*"))
    assert not list((out / "report").glob(".*"))

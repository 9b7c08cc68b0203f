"""What is compiled ahead of a machine's first picture is what the picture needs."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from numba.core.dispatcher import Dispatcher

from fabricusd.fabric import Binding
from fabricusd.reference.start.compile_ahead import _Process, compile_kernels
from fabricusd.reference.start.kernel_tasks import (
    CLOSE_UPS,
    EVERY_PICTURE,
    MASKED,
    NEAR_MASKED,
    NEAR_PROJECTED,
    NEAR_VISIBLE,
    PROJECTED,
    TASKS,
    VISIBLE,
)
from fabricusd.scene.scene import FabricSurface, PreviewSurface, Scene
from fabricusd.schema import load
from tests.reference.scenes import above, grid, render_scene

ROOT = Path(__file__).resolve().parents[3]


def signatures():
    """Of every compiled function: for which arguments it has been compiled, or read from disk."""
    return {
        f"{name}.{key}": list(value.signatures)
        for name, module in list(sys.modules.items())
        for key, value in vars(module).items()
        if name.startswith("fabricusd.") and isinstance(value, Dispatcher)
    }


def picture(level, law="masked"):
    """Cloth and a plain floor, small."""
    cloth = replace(load("linen_plain"), surface_law=law)
    scene = Scene(
        meshes=[grid(), grid(material=1, size=2.0)],
        materials=[
            FabricSurface(binding=Binding(fabric=cloth, metres_per_uv=1.0)),
            PreviewSurface(),
        ],
        camera=above(width=4.0),
    )
    render_scene(scene, width=8, height=8, spp=1, level=level)


def test_a_picture_compiles_nothing_that_was_not_compiled_ahead():
    for task in (*TASKS[EVERY_PICTURE], *TASKS[MASKED]):
        task()
    before = signatures()
    picture("far")
    assert signatures() == before
    for law, tasks in (("projected", PROJECTED), ("visible", VISIBLE)):
        for task in TASKS[tasks]:
            task()
        before = signatures()
        picture("far", law)
        assert signatures() == before
    for task in TASKS[CLOSE_UPS]:
        task()
    for law, near in (
        ("masked", NEAR_MASKED), ("projected", NEAR_PROJECTED), ("visible", NEAR_VISIBLE)
    ):  # fmt: skip
        for task in TASKS[near]:
            task()
        before = signatures()
        for level in ("weave", "thread"):
            picture(level, law)
        assert signatures() == before


SECOND_START = """
from numba.core import event
from tests.reference.start.test_compile_ahead import picture

class Compiled(event.Listener):
    def on_start(self, event):
        print(event.data["dispatcher"].py_func.__qualname__)

    def on_end(self, event):
        pass

event.register("numba:compile", Compiled())
picture("far")
"""


def test_a_second_start_compiles_nothing():
    picture("far")
    run = [sys.executable, "-c", SECOND_START]
    done = subprocess.run(run, cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == ""


def test_processes_share_the_kernels_out_by_claims(tmp_path, monkeypatch):
    done = []

    def first():
        done.append("first")

    def second():
        done.append("second")

    monkeypatch.setattr(
        "fabricusd.reference.start.compile_ahead.TASKS", {EVERY_PICTURE: (first, second)}
    )
    (tmp_path / "first").touch()
    compile_kernels(EVERY_PICTURE, str(tmp_path), backwards=False)
    compile_kernels(EVERY_PICTURE, str(tmp_path), backwards=True)
    assert done == ["second"]


LISTS = """
from fabricusd.reference.start import compile_ahead as ahead

ahead.TASKS = {name: () for name in ("one", "two")}
ahead._PATIENCE = 60.0
ahead.compile_lists("claims", False)
"""


def test_a_process_goes_through_lists_until_there_are_none():
    run = [sys.executable, "-c", LISTS]
    done = subprocess.run(
        run, cwd=ROOT, input="two\none\n", capture_output=True, text=True, check=True
    )
    assert done.stdout == "two\none\n"


def test_nobody_waits_for_a_process_that_has_ended(tmp_path):
    process = _Process(str(tmp_path), False)
    process.ask("no such list")
    process.wait("no such list")
    process.wait(EVERY_PICTURE)
    assert not process.lives

"""Commands that are killed at any time leave old or new files, whole, and the next run no debris.

`FABRICUSD_FUZZ=long pytest -s tests/cli/test_kills.py` kills thirty times, and says what it saw.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

from fabricusd.images.files import read_image, write_png
from fabricusd.scene.read import read_scene
from fabricusd.stop import SIGNALS
from fabricusd.weaves import read_wif
from tests.fuzz import examples

ROOT = str(Path(__file__).resolve().parents[2])
OLD = b'#usda 1.0\n(\n    customLayerData = {\n        string fabricusd = "old"\n    }\n)\n'
"""What lies under every name before; as a layer it is ours, and may be replaced."""

SQUARE = """v 0 0 0\nv 0.01 0 0\nv 0.01 0.01 0\nv 0 0.01 0
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"""

BAKE = ["bake", "x.obj", "--fabric", "velvet", "--resolution", "64", "--maps", "normal", "albedo"]
COMMANDS = {
    "new, text": ["new", "--preset", "velvet", "-o", "out.usda"],
    "new, crate": ["new", "--weave", "satin 8 step 3", "-o", "out.usdc"],
    "new, draft": ["new", "--weave", "mod(2*i + j, 5) < 2", "-o", "out.wif"],
    "render": ["render", "x.obj", "--fabric", "velvet", "-o", "out.exr", "--width", "96",
               "--height", "96", "--spp", "64", "--aov", "all"],
    "compare": ["compare", "a.png", "b.png", "-o", "out.png"],
    "demo": ["demo", "-o", "out"],
    "bake": [*BAKE, "-o", "out"],
    "material": ["material", "baked", "--no-fit", "-o", "out.usda", "--osl", "--u3m", "swatch",
                 "--usdz", "out.usdz", "--glb", "out.glb"],
}  # fmt: skip

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them"),
]


def run(folder: Path, arguments: list[str]) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "fabricusd", *arguments, "-q"], cwd=folder,
        env={**os.environ, "PYTHONPATH": ROOT}, preexec_fn=_defaults,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def _defaults() -> None:
    """What runs in the background of a script is started with some signals ignored."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL)


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


class Trial:
    """One command: its inputs, what it writes, and how long it takes."""

    def __init__(self, folder: Path, name: str) -> None:
        self.arguments = COMMANDS[name]
        self.inputs = folder / "inputs"
        self.inputs.mkdir(parents=True)
        (self.inputs / "x.obj").write_text(SQUARE)
        if "compare" in self.arguments:
            for one, value in (("a", 0), ("b", 255)):
                write_png(self.inputs / f"{one}.png", np.full((256, 256, 3), value, np.uint8))
        if "material" in self.arguments:
            process = run(self.inputs, [*BAKE, "-o", "baked"])
            assert process.communicate()[1] == ""
            (self.inputs / "swatch").mkdir()
        whole = folder / "whole"
        shutil.copytree(self.inputs, whole)
        began = time.monotonic()
        process = run(whole, self.arguments)
        err = process.communicate()[1]
        self.status = process.returncode
        self.seconds = time.monotonic() - began
        self.all = files(whole)
        given = files(self.inputs)
        self.new = {name: data for name, data in self.all.items() if given.get(name) != data}
        assert self.new, err
        again = folder / "again"
        shutil.copytree(self.inputs, again)
        run(again, self.arguments).communicate()
        same = files(again)
        self.fixed = {name for name in self.new if same.get(name) == self.new[name]}

    def with_old_files(self, folder: Path) -> Path:
        shutil.copytree(self.inputs, folder)
        for name in self.new:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(OLD)
        return folder

    def require_whole(self, folder: Path, *, old: bool) -> int:
        """Every file is old or new, and whole; returns how many are new."""
        count = 0
        for name, data in files(folder).items():
            if name not in self.new or (old and data == OLD):
                continue
            count += 1
            if name in self.fixed:
                assert data == self.new[name], f"{name} is neither old nor new"
            else:
                require_readable(folder / name)
        return count


def require_readable(path: Path) -> None:
    """A whole file of its kind, of a command that does not write the same bytes twice."""
    if path.suffix in (".exr", ".png"):
        assert read_image(path).size
    elif path.suffix in (".usda", ".usdc", ".usdz"):
        assert Usd.Stage.Open(str(path)).GetRootLayer()
    elif path.suffix in (".json", ".u3m"):
        json.loads(path.read_text())
    elif path.suffix == ".glb":
        assert read_scene(path, fabric="velvet").meshes
    elif path.suffix == ".u3ma":
        with zipfile.ZipFile(path) as archive:
            assert archive.testzip() is None
    elif path.suffix == ".wif":
        read_wif(path)
    elif path.suffix == ".html":
        assert path.read_text().rstrip().endswith("</html>")
    else:
        pytest.fail(f"{path.name}: nothing here tells a whole file from half of one")


def kill(process: subprocess.Popen, folder: Path, number: int, after: float, writing: bool) -> None:
    """Send a signal after so many seconds, or as soon after them as something is being written."""
    time.sleep(after)
    while writing and process.poll() is None and not any(folder.rglob(".*.partial-*")):
        time.sleep(0.0005)
    process.send_signal(number)


@pytest.fixture(scope="module")
def trials(tmp_path_factory):
    made: dict[str, Trial] = {}

    def trial(name: str) -> Trial:
        if name not in made:
            made[name] = Trial(tmp_path_factory.mktemp("trial"), name)
        return made[name]

    return trial


KILLS = 30
IN_SUITE = ("new, text", "render", "compare")


def cases():
    """Numbers of kills; each has its command, signal and moment by a fixed stream."""
    return range(examples(len(IN_SUITE), KILLS))


@pytest.mark.parametrize("case", cases())
def test_a_killed_command_leaves_whole_files_and_the_next_run_no_debris(tmp_path, trials, case):
    chance = random.Random(case)
    names = list(COMMANDS) if examples(0, 1) else IN_SUITE
    trial = trials(names[case % len(names)])
    number = (signal.SIGKILL, *SIGNALS)[(case + case // len(names)) % 4]
    writing = chance.random() < 0.5
    after = trial.seconds * (0.0 if writing else chance.uniform(0.05, 1.0))
    folder = trial.with_old_files(tmp_path / "here")

    process = run(folder, trial.arguments)
    kill(process, folder, number, after, writing)
    err = process.communicate(timeout=300)[1]
    left = sum(".partial-" in name for name in files(folder))
    print(
        f"\n{case:2} {' '.join(trial.arguments)[:40]:40} signal {number:2} "
        f"{'writing' if writing else f'{after:5.1f} s'}: status {process.returncode}, "
        f"{trial.require_whole(folder, old=True)} of {len(trial.new)} new, {left} partial",
        end="",
    )
    # What comes while Python itself starts or ends is not ours to answer.
    assert process.returncode in (0, 1, 130, -number), err
    if process.returncode == 130:
        assert len(err.splitlines()) == 1, err
        assert left == 0

    process = run(folder, trial.arguments)
    err = process.communicate(timeout=300)[1]
    assert process.returncode == trial.status, err
    assert trial.require_whole(folder, old=False) == len(trial.new)
    assert set(files(folder)) == set(trial.all)

"""Run the add-on, as `fabricusd blender-addon` writes it, in an interpreter that has bpy.

The interpreter is `build/bpy/bin/python`, which `make blender` makes, or FABRICUSD_BPY.
"""

from __future__ import annotations

import json
import os
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import pytest

from fabricusd.materials.targets.blender.pack import write_addon

INSIDE = Path(__file__).with_name("inside_blender.py")

MADE = Path(__file__).resolve().parents[5] / "build" / "bpy" / "bin" / "python"


def interpreter() -> str:
    """The interpreter; the test is skipped without one."""
    path = os.environ.get("FABRICUSD_BPY", str(MADE))
    if not Path(path).is_file():
        pytest.skip("no interpreter with bpy; `make blender` makes one")
    return path


def in_blender(folder: Path, *steps: dict[str, Any]) -> list[Any]:
    """Run steps of `inside_blender` one after another; return what each returns."""
    python = interpreter()
    package = write_addon(folder / "fabricusd_looks.zip")
    with zipfile.ZipFile(package) as zipped:
        zipped.extractall(folder / "addons")
    job, answer = folder / "job.json", folder / "answer.json"
    job.write_text(json.dumps({"addons": str(folder / "addons"), "steps": steps}))
    # Neither this checkout nor the user's own settings are Blender's business.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    environment["BLENDER_USER_RESOURCES"] = str(folder / "user")
    environment["SAID"] = str(folder / "said.txt")
    with (folder / "said.txt").open("w") as said:
        run = [python, "-u", str(INSIDE), str(job), str(answer)]
        done = subprocess.run(run, stdout=said, stderr=said, env=environment, timeout=600)
    assert done.returncode == 0, (folder / "said.txt").read_text()[-6000:]
    return list(json.loads(answer.read_text()))

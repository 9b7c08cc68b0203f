"""The tutorial and the how-to pages, as they stand: every command in its order, then Blender."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from fabricusd.images.files import read_image
from tests.docs.pages import PAGES, ROOT, blocks, commands
from tests.docs.test_commands import words_of
from tests.materials.targets.blender.addon.blender import interpreter

TUTORIAL = "docs/tutorial.md"

INSTALL = """
import bpy, sys
bpy.ops.preferences.addon_enable(module="bl_pkg")
bpy.ops.extensions.package_install_files(
    filepath=sys.argv[1], repo="user_default", enable_on_install=True
)
bpy.ops.wm.save_userpref()
"""


HOW_TO = [page for page in PAGES if page.startswith("docs/how-to/") and commands(page)]
READERS_OWN = {"docs/how-to/photograph.md"}
"""Pages whose commands need files of the reader's."""


def walk(page, folder):
    """Run every command of a page in `folder`."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    for line in commands(page):
        run = [sys.executable, "-m", "fabricusd", *words_of(line)]
        done = subprocess.run(run, cwd=folder, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, f"{line}\n{done.stderr}"


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    """A folder in which every command of the tutorial was run."""
    folder = tmp_path_factory.mktemp("tutorial")
    walk(TUTORIAL, folder)
    return folder


@pytest.mark.exhaustive
@pytest.mark.parametrize("page", [page for page in HOW_TO if page not in READERS_OWN])
def test_every_command_of_a_how_to_page_works(page, tmp_path):
    walk(page, tmp_path)


@pytest.mark.exhaustive
def test_every_command_of_the_tutorial_works(walked):
    made = {path.name for path in walked.iterdir()}
    assert {"skirt.usda", "skirt.png", "baked", "look.usda", "fabricusd_looks.zip"} <= made


@pytest.mark.exhaustive
def test_blender_renders_the_look_by_the_script_of_the_tutorial(walked):
    python = interpreter()
    (script,) = blocks(TUTORIAL, "python")
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    environment["BLENDER_USER_RESOURCES"] = str(walked / "user")
    for name, code in (("install.py", INSTALL), ("picture.py", script)):
        (walked / name).write_text(code)
        run = [python, name, str(walked / "fabricusd_looks.zip")]
        done = subprocess.run(run, cwd=walked, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    # The skirt is in the middle of the picture, and blue; the backdrop around it is grey.
    red, _, blue = read_image(walked / "blender.png")[150:210, 290:350].mean(axis=(0, 1))
    assert blue > 2 * red

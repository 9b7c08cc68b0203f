"""The add-on as a file to install, and the command that writes it."""

from __future__ import annotations

import tomllib
import zipfile

import pytest

from fabricusd.errors import FabricError
from fabricusd.materials.targets.blender.addon import bl_info
from fabricusd.materials.targets.blender.pack import MANIFEST, NAME, SOURCE, write_addon
from tests.cli.commands import run


def test_the_file_holds_the_add_on_in_one_folder(tmp_path, capsys):
    path = tmp_path / "addon.zip"
    assert run(capsys, "blender-addon", str(path)) == (0, f"{path}\n", "")
    with zipfile.ZipFile(path) as package:
        names = set(package.namelist())
        said = tomllib.loads(package.read(f"{NAME}/{MANIFEST}").decode())
    assert names == {f"{NAME}/{one.name}" for one in SOURCE.glob("*.*")}
    assert said["id"] == NAME


def test_both_kinds_of_add_on_say_the_same():
    said = tomllib.loads((SOURCE / MANIFEST).read_text("utf-8"))
    assert said["version"] == ".".join(map(str, bl_info["version"]))
    assert said["blender_version_min"] == ".".join(map(str, bl_info["blender"]))
    assert said["name"] == bl_info["name"]


def test_the_same_version_is_the_same_file(tmp_path):
    first, second = (write_addon(tmp_path / f"{k}.zip").read_bytes() for k in (1, 2))
    assert first == second


def test_a_folder_is_replaced_if_it_is_an_add_on(tmp_path):
    folder = tmp_path / "looks"
    write_addon(folder)
    (folder / "old.py").write_text("")
    write_addon(folder)
    assert {one.name for one in folder.iterdir()} == {one.name for one in SOURCE.glob("*.*")}
    assert [one.name for one in tmp_path.iterdir()] == ["looks"]


@pytest.mark.parametrize("name", ["mine", "addon.tar", "none/addon.zip"])
def test_anything_else_is_refused_and_left_as_it_is(tmp_path, capsys, name):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("")
    status, out, err = run(capsys, "blender-addon", str(tmp_path / name))
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert [one.name for one in tmp_path.rglob("*")] == ["mine", "letter.txt"]


@pytest.mark.parametrize("name", ["looks", "looks.zip"])
def test_no_clobber_keeps_what_there_is(tmp_path, name):
    write_addon(tmp_path / name)
    with pytest.raises(FabricError):
        write_addon(tmp_path / name, clobber=False)

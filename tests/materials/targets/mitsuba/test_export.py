"""The files for Mitsuba: a fabric each, and the plugin."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from fabricusd.errors import FabricError
from fabricusd.materials.targets import Job
from fabricusd.materials.targets.mitsuba import export
from fabricusd.schema import load


def job(notes, **fabrics):
    return Job(
        look=None, garments=(), recipes={}, fabrics=fabrics, fitted=False, clobber=True,
        note=notes.append,
    )  # fmt: skip


def test_it_writes_a_fabric_each_and_the_plugin(tmp_path):
    notes = []
    made = export.write(job(notes, linen=load("linen_plain")), tmp_path / "cloth")
    assert [one.name for one in made] == ["linen.json", "fabricusd_cloth.py"]
    said = json.loads(made[0].read_text())
    assert said["law"] == "visible"
    weight = sum(one["weight"] for one in said["nodes"])
    assert weight + said["gap"] == pytest.approx(1.0)
    shape = said["columns"] + 1, said["elevations"], len(said["nodes"])
    assert len(said["means"]) == math.prod(shape)
    assert made[1].read_text() == export.PLUGIN.read_text()
    assert not notes


def test_a_fabric_that_the_plugin_has_not_is_a_note(tmp_path):
    notes = []
    linen = load("linen_plain")
    made = export.write(job(notes, own=replace(linen, model="conserving")), tmp_path / "cloth")
    assert not made
    assert "no Mitsuba fabric for own: thread" in notes[0]
    assert "it must be 'microcylinder'" in notes[0]


def test_the_folder_is_checked_before_any_work(tmp_path):
    (tmp_path / "file").write_text("")
    for name in ("file", "none/cloth"):
        with pytest.raises(FabricError, match="--mitsuba"):
            export.check(tmp_path / name, True)

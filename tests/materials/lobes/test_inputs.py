"""A mixture as inputs of a material: Blender's add-on reads what was written."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest
from materials.lobes.mixtures import LEVEL, PAIR, mixture
from pxr import Sdf, Usd

from fabricusd.materials.lobes.inputs import inputs
from fabricusd.materials.lobes.mixture import CYCLES, OF_MATERIALX
from fabricusd.materials.targets.blender.addon import looks
from fabricusd.materials.targets.write_usd import write_material


def read_back(folder, one, matrix):
    stage = Usd.Stage.CreateNew(str(folder / "look.usda"))
    write_material(stage, Sdf.Path("/Cloth"), [], inputs(one, "linen", matrix), folder)
    stage.GetRootLayer().Save()
    (found,) = looks.read(Usd.Stage.Open(str(folder / "look.usda")))
    return found


@pytest.mark.parametrize("view", [True, False])
def test_the_add_on_reads_the_mixture_that_was_written(tmp_path, view):
    one = mixture(CYCLES, PAIR, replace(LEVEL, tilt=-0.3))
    one = one if view else replace(one, view=())
    found = read_back(tmp_path, one, np.eye(2))
    assert found.fabric == "linen"
    said, truth = asdict(found.mixture), asdict(one)
    assert truth.pop("form") == CYCLES
    for mine, theirs in zip(said.pop("lobes"), truth.pop("lobes"), strict=True):
        assert mine.pop("along") == ("weft", "warp")[theirs.pop("along")]
        theirs = {name: value for name, value in theirs.items() if name not in OF_MATERIALX}
        assert_same(mine, theirs)
    assert_same(said, truth)


def assert_same(said, truth):
    assert set(said) == set(truth)
    for name, value in truth.items():
        assert said[name] == pytest.approx(value, rel=1e-6), name


def test_weft_and_warp_are_directions_of_texture_space(tmp_path):
    # Threads that run along u + v, twice as dense as those across.
    matrix = np.array([[200.0, 200.0], [-100.0, 100.0]])
    found = read_back(tmp_path, mixture(CYCLES), matrix)
    assert found.weft == pytest.approx((0.5**0.5, 0.5**0.5))
    assert found.warp == pytest.approx((-(0.5**0.5), 0.5**0.5))

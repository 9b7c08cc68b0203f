"""Attributes of a wrong type or with values out of range: a note each, and the rest is rendered."""

from __future__ import annotations

import re

import numpy as np
import pytest
from pxr import Sdf

from fabricusd.errors import FabricError
from fabricusd.reference.camera import build_lens
from fabricusd.reference.read import read_scene
from tests.conftest import CHECKOUT

CASES = CHECKOUT / "tests" / "cases"
WHOLE = CASES / "usd_everything" / "scene.usda"

WRONG = {
    "int[]": "</x>", "float[]": "</x>", "point3f[]": '"a"', "normal3f[]": "[1, 2]",
    "texCoord2f[]": "</x>", "float3[]": "</x>", "quath[]": "</x>", "token": "</x>",
    "float": "</x>", "float2": "</x>", "bool": "</x>", "color3f": "</x>", "asset": "</x>",
    "color3f[]": "</x>", "half3[]": "</x>", "matrix4d": "</x>", "matrix4d[]": "</x>",
    "token[]": "</x>", "double": "</x>", "double3": "</x>", "float4": "</x>", "int64[]": "</x>",
    "vector3f[]": "</x>", "quatf[]": "</x>", "color3d": "</x>", "double[]": "</x>",
    "string[]": "</x>",
}  # fmt: skip
"""A value of each type that the parser takes and no reader can use."""


def attributes() -> dict[str, tuple[int, str]]:
    """Every attribute of the scene: its line, and that line with a path for a value."""
    found = {}
    prim = ""
    for k, line in enumerate(WHOLE.read_text().splitlines()):
        named = re.match(r'\s*(?:def|over) \w* ?"(\w+)"', line)
        prim = named[1] if named else prim
        parts = re.match(r"(\s*(?:uniform )?([\w\[\]]+) ([\w:]+) = )[^{]*?( \()?$", line)
        if parts and parts[2] in WRONG:
            found[f"{prim}.{parts[3]}"] = k, f"{parts[1]}</x>{parts[4] or ''}"
    return found


ATTRIBUTES = attributes()


@pytest.fixture
def beside(tmp_path):
    for name in ("tex.png", "env.exr"):
        (tmp_path / name).symlink_to(WHOLE.parent / name)
    return tmp_path


@pytest.mark.parametrize("name", ATTRIBUTES)
def test_an_attribute_that_holds_a_path_is_read_without_or_refused(beside, name):
    assert len(ATTRIBUTES) > 100
    number, changed = ATTRIBUTES[name]
    lines = WHOLE.read_text().splitlines()
    lines[number] = changed
    (beside / "scene.usda").write_text("\n".join(lines))
    scene = read_scene(beside / "scene.usda", time_code=2.0, complexity="medium")
    assert scene.meshes
    for mesh in scene.meshes:
        assert np.isfinite(mesh.points).all()

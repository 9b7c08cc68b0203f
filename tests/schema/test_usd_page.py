"""What the page of USD says about putting a fabric on a garment works as it is written there."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from fabricusd.cli.main import main
from fabricusd.scene.usd.stage import read_usd_scene
from fabricusd.schema import load

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "usd.md"

SHAPE = """
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
        interpolation = "vertex"
    )
    uniform token subdivisionScheme = "none"
"""


def test_a_garment_wears_a_preset_by_reference(tmp_path, monkeypatch):
    text = PAGE.read_text()
    command = re.search(r"fabricusd (new --preset (\w+) -o silk\.usda)", text)
    blocks = re.findall(r"```usda\n(.*?)```", text, re.DOTALL)
    (block,) = [b for b in blocks if "WovenBindingAPI" in b]
    monkeypatch.chdir(tmp_path)
    assert main(command[1].split()) == 0
    scene = tmp_path / "scene.usda"
    head = "#usda 1.0\n(\n    metersPerUnit = 1\n)\n"
    scene.write_text(head + block.replace("    ...\n", SHAPE))
    read = read_usd_scene(scene)
    (surface,) = read.materials
    assert read.notes == []
    assert surface.binding.fabric == replace(load(command[2]), name="Silk")
    assert surface.binding.metres_per_uv == 0.4
    assert main(["check", "--strict", str(scene)]) == 0

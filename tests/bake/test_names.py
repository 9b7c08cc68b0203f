"""Names of garments and fabrics: files of two never meet, on any file system."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fabricusd.bake.layout.garment import garments
from fabricusd.bake.names import LONGEST, different_names, file_stem, folded, is_file_stem
from fabricusd.cli.main import main
from fabricusd.fabric import Binding, Fabric
from fabricusd.images.files import read_mip_level
from fabricusd.scene.scene import FabricSurface
from tests.bake.meshes import quad_mesh, quad_scene

CASES = Path(__file__).resolve().parents[1] / "cases" / "hostile"


def test_each_of_three_meshes_keeps_its_textures(tmp_path, capsys):
    """Two of the names are alike, and the third is what the second would be called."""
    words = ["bake", str(CASES / "name_collision.usda"), "--fabric", "linen_plain"]
    assert main([*words, "--resolution", "64", "--maps", "lay", "-o", str(tmp_path)]) == 0
    said = json.loads((tmp_path / "manifest.json").read_text())["garments"]
    prims = {name: one["prims"] for name, one in said.items()}
    assert prims == {
        "cloth": ["/W/A/cloth"],
        "cloth_2": ["/W/C/cloth_2"],
        "cloth_3": ["/W/B/cloth"],
    }
    covered = {"cloth": 1.0, "cloth_3": 0.25, "cloth_2": 1 / 16}
    for name, share in covered.items():
        file = said[name]["files"]["lay"]["1001"]["file"]
        found = np.mean(read_mip_level(tmp_path / file)[..., 0] == 0)
        # Margins and texels that are touched make it more.
        assert share <= found < share + 0.5
        assert (tmp_path / f"{name}.usdc").is_file()


@pytest.mark.parametrize(
    ("wanted", "names"),
    [
        (("cloth", "cloth", "cloth"), ("cloth", "cloth_2", "cloth_3")),
        (("cloth", "cloth", "cloth_2"), ("cloth", "cloth_3", "cloth_2")),
        (("cloth", "Cloth", "CLOTH"), ("cloth", "Cloth_2", "CLOTH_3")),
        (("con", "Nul", "COM1"), ("con_2", "Nul_2", "COM1_2")),
        (("fabrics", "Manifest", "report"), ("fabrics_2", "Manifest_2", "report_2")),
        (("a-b", "a_b"), ("a-b", "a_b_2")),
        (("stra\u00dfe", "strasse"), ("stra\u00dfe", "strasse_2")),
        (("\u00e9", "e\u0301"), ("\u00e9", "e\u0301_2")),
        (("x" * LONGEST, "x" * LONGEST), ("x" * LONGEST, "x" * (LONGEST - 2) + "_2")),
    ],
)
def test_names_differ_however_they_are_folded(wanted, names):
    assert tuple(different_names(wanted)) == names


@given(st.lists(st.text(max_size=12) | st.sampled_from(["a", "A", "a_2", "con", ".."]), max_size=8))
def test_any_names_become_files_that_differ(texts):
    names = different_names([file_stem(text) for text in texts])
    taken: set[str] = set()
    for name in names:
        assert is_file_stem(name)
        assert not set("/\\:.\0") & set(name)
        assert len(name.encode()) <= LONGEST
        assert taken.isdisjoint(folded(name))
        taken |= folded(name)


@pytest.mark.parametrize(
    "name", ["", "..", "a/b", "a\\b", "a.b", "-x", "con", "LPT1", "a\0b", " a"]
)
def test_what_no_baker_writes_is_no_name(name):
    assert not is_file_stem(name)


def test_fabrics_get_names_of_files_too():
    scene = quad_scene(Fabric(name="Cloth"))
    for k, name in enumerate(("cloth", "../x", "nul"), start=1):
        binding = Binding(fabric=Fabric(name=name, opaque=True), threads_per_uv=(8.0, 8.0))
        scene.materials.append(FabricSurface(binding=binding))
        mesh = quad_mesh(path=f"/Other{k}", move=3.0 * k)
        scene.meshes.append(replace(mesh, material=np.full(2, k, np.int32)))
    names = [one.lays[0].fabric.name for one in garments(scene)]
    assert names == ["Cloth", "cloth_2", "_x", "nul_2"]

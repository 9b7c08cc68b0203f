"""Layers from before the types had a prefix are read as the same fabrics, with a warning."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from pxr import Usd

from fabricusd import FabricError
from fabricusd.scene.usd.stage import read_usd_scene
from fabricusd.schema import PLUGIN_PATH, check, load, preset_names
from fabricusd.schema.access import EARLIER_NAMES, applies_binding, remove_binding
from fabricusd.schema.source import PRESETS

ROOT = Path(__file__).parents[1]
LAYERS = [*sorted((ROOT / "cases").rglob("*.usda")), *sorted((ROOT / "schema/bad").glob("*.usda"))]
OF_OURS = [
    path for path in LAYERS if any(new in path.read_text() for new in EARLIER_NAMES.values())
]


def with_earlier_names(text: str) -> str:
    for earlier, now in EARLIER_NAMES.items():
        text = text.replace(f"def {now} ", f"def {earlier} ").replace(f'"{now}"', f'"{earlier}"')
    return text


def with_new_names(problem: str) -> str:
    for earlier, now in EARLIER_NAMES.items():
        problem = re.sub(rf"\b{earlier}\b", now, problem)
    return problem


@pytest.mark.parametrize("name", preset_names())
def test_a_preset_under_the_earlier_names_is_the_same_fabric(name, tmp_path):
    for path in PRESETS.rglob("*.usda"):
        (tmp_path / path.name).write_text(with_earlier_names(path.read_text()))
    assert "Woven" not in (tmp_path / f"{name}.usda").read_text()
    assert load(tmp_path / f"{name}.usda") == load(name)


def test_each_earlier_name_is_a_warning_with_its_place_and_the_name_to_write(tmp_path):
    scene = tmp_path / "scene.usda"
    scene.write_text(
        with_earlier_names((ROOT / "cases/usd_subset_false_note/G.usda").read_text())
        + """
def Mesh "Sheet" (
    prepend apiSchemas = ["FabricBindingAPI"]
)
{
    rel fabric:binding = </G>
    texCoord2f[] primvars:st = [(0, 0)]
}
"""
    )
    found = [(f.severity, f.rule, f.prim, f.problem) for f in check(scene)]
    threads = [prim for _, _, prim, _ in found if prim.startswith("/G/")]
    words = "an earlier name of the schema; write"
    name = "NameIsCurrent"
    assert threads
    assert found == [
        ("warning", name, "/G", f"is of the type Fabric, {words} WovenFabric"),
        *(
            ("warning", name, prim, f"is of the type FabricThread, {words} WovenThread")
            for prim in threads
        ),
        ("warning", name, "/Sheet", f"applies FabricBindingAPI, {words} WovenBindingAPI"),
    ]


def test_a_binding_under_the_earlier_name_can_be_taken_off():
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(
        '#usda 1.0\ndef Mesh "Sheet" (\n    prepend apiSchemas = ["FabricBindingAPI"]\n)\n'
        "{\n    rel fabric:binding\n}\n"
    )
    prim = stage.GetPrimAtPath("/Sheet")
    assert applies_binding(prim)
    remove_binding(prim)
    assert not applies_binding(prim)


@pytest.mark.parametrize("layer", OF_OURS, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_every_other_finding_of_a_layer_is_the_same_under_the_earlier_names(layer, tmp_path):
    def findings(path: Path) -> list[tuple[str, str, str, str]]:
        try:
            found = check(path)
        except FabricError as error:
            return [("", "", "", str(error).replace(str(path.parent), ""))]
        found = [f for f in found if f.rule != "NameIsCurrent"]
        return [(f.rule, f.prim, f.property, with_new_names(f.problem)) for f in found]

    for folder, words in ((tmp_path / "now", str), (tmp_path / "earlier", with_earlier_names)):
        beside = [(path, path.relative_to(layer.parent)) for path in layer.parent.rglob("*.usda")]
        presets = [(path, Path(path.name)) for path in PRESETS.rglob("*.usda")]
        for path, name in (*beside, *presets):
            (folder / name).parent.mkdir(exist_ok=True, parents=True)
            (folder / name).write_text(words(path.read_text()))
    assert findings(tmp_path / "earlier" / layer.name) == findings(tmp_path / "now" / layer.name)


def test_a_mesh_under_the_earlier_names_wears_its_fabric(tmp_path):
    folder = ROOT / "cases" / "usd_subset_false_note"
    for path in folder.glob("*.usda"):
        (tmp_path / path.name).write_text(with_earlier_names(path.read_text()))
    now, earlier = (read_usd_scene(each / "subset.usda") for each in (folder, tmp_path))
    assert [m.binding for m in earlier.materials] == [m.binding for m in now.materials]
    assert earlier.notes == now.notes == []


def test_a_fabric_at_its_fallbacks_is_known_by_its_threads(tmp_path):
    path = tmp_path / "bare.usda"
    path.write_text('#usda 1.0\ndef Fabric "A"\n{\n    def FabricThread "T"\n    {\n    }\n}\n')
    text = with_earlier_names(path.read_text())
    bare = load(path)
    path.with_name("new.usda").write_text(
        text.replace("FabricThread", "WovenThread").replace("def Fabric ", "def WovenFabric ")
    )
    assert bare == replace(load(path.with_name("new.usda")), name="A")


def test_a_prim_called_fabric_that_holds_nothing_of_ours_is_left_alone(tmp_path):
    path = tmp_path / "other.usda"
    path.write_text('#usda 1.0\ndef Fabric "Network"\n{\n    int nodes = 3\n}\n')
    assert check(path) == []
    with pytest.raises(FabricError, match="has no WovenFabric prim"):
        load(path)


OTHER_PLUGIN = {
    "Plugins": [{
        "Type": "resource", "Name": "other", "Root": ".", "LibraryPath": "", "ResourcePath": ".",
        "Info": {"Types": {"OtherFabric": {
            "alias": {"UsdSchemaBase": "Fabric"}, "autoGenerated": True, "bases": ["UsdTyped"],
            "schemaIdentifier": "Fabric", "schemaKind": "concreteTyped"}}},
    }]
}  # fmt: skip
OTHER_SCHEMA = """#usda 1.0
class Fabric "Fabric" (
    doc = "Another program's."
)
{
    double fabric:size = 1
}
"""
LOOK = """
import json, sys
from fabricusd.schema import check
print(json.dumps([str(f) for f in check(sys.argv[1])]))
"""


def test_a_type_of_another_plugin_is_not_taken_for_ours(tmp_path):
    plugin = tmp_path / "plugin"
    plugin.mkdir()
    (plugin / "plugInfo.json").write_text(json.dumps(OTHER_PLUGIN))
    (plugin / "generatedSchema.usda").write_text(OTHER_SCHEMA)
    scene = tmp_path / "scene.usda"
    scene.write_text('#usda 1.0\ndef Fabric "Network"\n{\n    double fabric:size = 2\n}\n')
    environment = {**os.environ, "PYTHONPATH": str(PLUGIN_PATH.parents[2])}
    found = {}
    for path in ("", str(plugin)):
        environment["PXR_PLUGINPATH_NAME"] = path
        done = subprocess.run(
            [sys.executable, "-c", LOOK, str(scene)],
            capture_output=True, text=True, env=environment, check=True,
        )  # fmt: skip
        found[bool(path)] = json.loads(done.stdout)
    assert found[True] == []
    assert any("NameIsCurrent" in line for line in found[False])

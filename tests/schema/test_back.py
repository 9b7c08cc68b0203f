"""The back of a fabric: it comes along with its front, and one that is lost is told of."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fabricusd import FabricError
from fabricusd.fabric import Fabric
from fabricusd.scene.scene import FabricSurface
from fabricusd.scene.usd.stage import read_usd_scene
from fabricusd.schema import check, load, save

SATIN = "polyester_satin_charmeuse"

SHEET = """#usda 1.0
(
    metersPerUnit = 1
)
def Mesh "Sheet" (
    prepend apiSchemas = ["WovenBindingAPI"]
)
{
    rel fabric:binding = </Looks/Satin>
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
        interpolation = "vertex"
    )
    uniform token subdivisionScheme = "none"
}
"""

SIBLINGS = """#usda 1.0
(
    defaultPrim = "Front"
)
def WovenFabric "Front"
{
    rel fabric:back = </Back>
    def WovenThread "Silk"
    {
    }
}
def WovenFabric "Back"
{
    bool fabric:opaque = true
    def WovenThread "Silk"
    {
    }
}
"""


def worn(scene: Path) -> tuple[Fabric, list[str]]:
    """What the scene's only mesh wears, and the notes."""
    read = read_usd_scene(scene)
    (surface,) = read.materials
    assert isinstance(surface, FabricSurface)
    return surface.binding.fabric, read.notes


def dressed(folder: Path, fabric: str) -> Path:
    """A scene in which a sheet wears the prim `Satin` that `fabric` defines."""
    scene = folder / "scene.usda"
    scene.write_text(f'{SHEET}\ndef "Looks"\n{{\n{fabric}\n}}\n')
    return scene


WAYS = {
    "a reference": 'def "Satin" (\n    references = @satin.usda@\n)\n{\n}',
    "a payload": 'def "Satin" (\n    payload = @satin.usda@\n)\n{\n}',
    "an instance": 'def "Satin" (\n    instanceable = true\n    references = @satin.usda@\n)\n{\n}',
    "a variant": 'def "Satin" (\nvariants = { string v = "on" }\nprepend variantSets = "v"\n)\n{\n'
    'variantSet "v" = {\n"on" (\n    references = @satin.usda@\n) {\n}\n}\n}',
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_a_referenced_fabric_keeps_its_back(way, tmp_path):
    save(load(SATIN), tmp_path / "satin.usda")
    scene = dressed(tmp_path, WAYS[way])
    fabric, notes = worn(scene)
    assert (fabric, notes) == (replace(load(SATIN), name="Satin"), [])
    assert check(scene) == []


def test_a_preset_is_referenced_where_it_lies(tmp_path):
    from fabricusd.schema.source import PRESETS

    scene = dressed(
        tmp_path, f'def "Satin" (\n    references = @{PRESETS / SATIN}.usda@\n)\n{{\n}}'
    )
    assert worn(scene)[0].back == load(f"{SATIN}_back")


LOST = {
    "a sibling outside of the reference": (
        'def "Satin" (references = @siblings.usda@)\n{\n}', "TargetsKept",
        "/Looks/Satin fabric:back loses its target /Back of siblings.usda"),
    "an instance of it": (
        'def "Satin" (\n    instanceable = true\n    references = @siblings.usda@\n)\n{\n}',
        "TargetsKept", "/Looks/Satin fabric:back loses its target /Back of siblings.usda"),
    "no prim": (
        'def "Satin" (references = @siblings.usda@)\n{\n    rel fabric:back = </Nowhere>\n}',
        "BackIsAFabric", "/Looks/Satin fabric:back targets /Nowhere, which does not exist"),
    "a prim of another type": (
        'def "Satin" (references = @siblings.usda@)\n{\n    rel fabric:back = </Sheet>\n}',
        "BackIsAFabric", "/Looks/Satin fabric:back targets /Sheet, Mesh"),
    "itself": (
        'def "Satin" (references = @siblings.usda@)\n'
        '{\n    rel fabric:back = </Looks/Satin>\n}',
        "RelationshipAcyclic", "/Looks/Satin fabric:back targets /Looks/Satin, its own prim"),
    "a fabric with a fault": (
        'def "Satin" (references = @siblings.usda@)\n'
        '{\n    rel fabric:back = </Looks/Satin/Back>\n    def WovenFabric "Back"\n    {\n    }\n}',
        "ThreadsExist", "/Looks/Satin/Back fabric:threads targets no thread"),
}  # fmt: skip


@pytest.mark.parametrize("case", LOST)
def test_a_back_that_is_lost_leaves_the_front_and_is_told_of(case, tmp_path, capfd):
    (tmp_path / "siblings.usda").write_text(SIBLINGS)
    fabric, rule, words = LOST[case]
    scene = dressed(tmp_path, fabric)
    front, notes = worn(scene)
    assert front == replace(load(tmp_path / "siblings.usda"), name="Satin", back=None)
    (note,) = notes
    assert note.startswith(f"/Sheet {words}")
    assert note.endswith("seen from behind it is its front, mirrored")
    (finding,) = check(scene)
    assert (finding.rule, finding.severity) == (rule, "error")
    assert words in str(finding)
    with pytest.raises(FabricError, match="must"):
        load(f"{scene}:/Looks/Satin")
    assert capfd.readouterr().err == ""


def test_a_back_that_is_named_anew_where_the_fabric_is_referenced_is_not_lost(tmp_path):
    (tmp_path / "siblings.usda").write_text(SIBLINGS)
    back = 'def "Back" (\n    references = @siblings.usda@</Back>\n)\n{\n}'
    front = (
        'def "Satin" (\n    references = @siblings.usda@\n)\n'
        f"{{\n    rel fabric:back = </Looks/Satin/Back>\n    {back}\n}}"
    )
    scene = dressed(tmp_path, front)
    fabric, notes = worn(scene)
    assert (fabric.back, notes) == (load(f"{tmp_path / 'siblings.usda'}:/Back"), [])
    assert check(scene) == []


def test_a_thread_that_is_lost_is_an_error_since_indices_would_move(tmp_path):
    (tmp_path / "two.usda").write_text(
        """#usda 1.0
(
    defaultPrim = "Cloth"
)
def WovenThread "Gold"
{
}
def WovenFabric "Cloth"
{
    rel fabric:threads = [</Gold>, </Cloth/Silk>]
    def WovenThread "Silk"
    {
    }
}
"""
    )
    (tmp_path / "shop.usda").write_text(
        '#usda 1.0\ndef WovenFabric "Cloth" (\n    references = @two.usda@\n)\n{\n}\n'
    )
    with pytest.raises(FabricError, match=r"fabric:threads loses its target /Gold of two\.usda"):
        load(tmp_path / "shop.usda")


def test_a_back_still_may_lie_beside_its_front(tmp_path):
    (tmp_path / "siblings.usda").write_text(SIBLINGS)
    assert load(tmp_path / "siblings.usda").back.opaque
    assert check(tmp_path / "siblings.usda") == []


def test_a_file_of_one_fabric_and_its_back_holds_one_fabric(tmp_path):
    save(load(SATIN), tmp_path / "satin.usda")
    text = (tmp_path / "satin.usda").read_text()
    (tmp_path / "plain.usda").write_text(text.replace(f'defaultPrim = "{SATIN}"', ""))
    assert load(tmp_path / "plain.usda") == load(SATIN)
    assert load(f"{tmp_path / 'satin.usda'}:/{SATIN}/{SATIN}_back") == load(f"{SATIN}_back")


OVER = """over "Looks"
{
    def WovenFabric "Satin"
    {
        rel fabric:back = </Looks/Satin/Back>
        def WovenThread "Silk"
        {
        }
        def WovenFabric "Back"
        {
            def WovenThread "Silk"
            {
            }
        }
    }
    def WovenThread "Of_a_library"
    {
    }
}
"""


def test_a_fabric_below_an_over_is_worn_and_told_of(tmp_path):
    scene = tmp_path / "scene.usda"
    scene.write_text(f"{SHEET}\n{OVER}")
    fabric, notes = worn(scene)
    assert (list(fabric.threads), fabric.back.name) == (["Silk"], "Back")
    assert notes == [
        "/Sheet wears /Looks/Satin, which lies below /Looks, an 'over' that no layer defines: "
        "other programs do not see it and show a grey; make it a 'def'"
    ]
    assert [(f.rule, f.severity, f.prim) for f in check(scene)] == [
        ("BoundFabricDefined", "error", "/Sheet"),
        ("BelowDefsAlone", "warning", "/Looks/Satin"),
        ("BelowDefsAlone", "warning", "/Looks/Of_a_library"),
    ]


def test_a_layer_that_only_overrides_is_clean(tmp_path):
    layer = tmp_path / "over.usda"
    layer.write_text(
        """#usda 1.0
over "Looks"
{
    over "Satin"
    {
        double fabric:warp:density = 30
        over "Silk"
        {
            double thread:ior = 1.4
        }
    }
}
over "Sheet"
{
    rel fabric:binding = </Looks/Satin>
}
"""
    )
    assert [f.rule for f in check(layer)] == []

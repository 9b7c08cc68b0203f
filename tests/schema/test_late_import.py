"""A program may use USD before it imports fabricusd: all that is read is the same."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from fabricusd.schema import PLUGIN_PATH

BAD = Path(__file__).parent / "bad"

USE_A_STAGE_FIRST = """
from pxr import Usd
stage = Usd.Stage.CreateInMemory()
stage.DefinePrim("/X", "Scope").HasAPI("CollectionAPI")
assert Usd.SchemaRegistry().FindConcretePrimDefinition("WovenFabric") is None
"""


def in_a_new_process(script: str, *arguments: str, late: bool) -> object:
    """What a script prints as JSON, run with fabricusd imported first or after a stage was used."""
    environment = {k: v for k, v in os.environ.items() if k != "PXR_PLUGINPATH_NAME"}
    environment["PYTHONPATH"] = str(PLUGIN_PATH.parents[2])
    head = USE_A_STAGE_FIRST if late else ""
    done = subprocess.run(
        [sys.executable, "-c", f"{head}\nimport fabricusd.schema, json, sys\n{script}", *arguments],
        capture_output=True, text=True, env=environment, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return json.loads(done.stdout)


def in_both_orders(script: str, *arguments: str) -> object:
    """What a script prints, which must not depend on the order."""
    early, late = (in_a_new_process(script, *arguments, late=late) for late in (False, True))
    assert late == early
    return early


PRESETS = """
from fabricusd.schema.describe import as_dict
print(json.dumps([as_dict(fabricusd.schema.load(n)) for n in fabricusd.schema.preset_names()]))
"""


def test_every_preset_is_read_the_same():
    assert len(in_both_orders(PRESETS)) > 10


CHECK = """
print(json.dumps([str(f) for file in sys.argv[1:] for f in fabricusd.schema.check(file)]))
"""


def test_every_rule_finds_the_same():
    samples = sorted(str(path) for path in BAD.glob("*.usda"))
    assert len(in_both_orders(CHECK, *samples)) >= len(samples)


WORN = """#usda 1.0
(
    metersPerUnit = 1
)
def WovenFabric "Cloth"
{
    def WovenThread "Silk"
    {
    }
}
class "Dressed" (
    prepend apiSchemas = ["WovenBindingAPI"]
)
{
    rel fabric:binding = </Cloth>
}
class "Sheet"
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
        interpolation = "vertex"
    )
    uniform token subdivisionScheme = "none"
}
def Mesh "Applied" (
    inherits = </Sheet>
    prepend apiSchemas = ["MaterialBindingAPI", "WovenBindingAPI"]
)
{
    rel fabric:binding = </Cloth>
}
def Mesh "Inherited" (
    inherits = [</Sheet>, </Dressed>]
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
}
def Mesh "Varied" (
    inherits = </Sheet>
    variants = { string look = "cloth" }
    prepend variantSets = "look"
)
{
    variantSet "look" = {
        "cloth" (
            inherits = </Dressed>
        )
        {
        }
    }
}
def Mesh "Taken_off" (
    inherits = [</Sheet>, </Dressed>]
    delete apiSchemas = ["WovenBindingAPI"]
)
{
}
def Mesh "Not_applied" (
    inherits = </Sheet>
)
{
    rel fabric:binding = </Cloth>
}
"""

SCENE = """
from pathlib import Path
from fabricusd.scene.usd.stage import read_usd_scene
scene = read_usd_scene(Path(sys.argv[1]))
print(json.dumps([
    {m.path: scene.materials[int(m.material[0])].name for m in scene.meshes}, scene.notes
]))
"""


def test_a_mesh_wears_its_fabric_where_the_api_is_applied_and_has_a_note_where_not(tmp_path):
    (tmp_path / "worn.usda").write_text(WORN)
    worn, notes = in_both_orders(SCENE, str(tmp_path / "worn.usda"))
    assert worn == {
        "/Applied": "Cloth",
        "/Inherited": "Cloth",
        "/Varied": "Cloth",
        "/Taken_off": "grey",
        "/Not_applied": "grey",
    }
    left_out = "has fabric:binding but not WovenBindingAPI applied, left out"
    assert notes == [f"/Taken_off {left_out}", f"/Not_applied {left_out}"]


BIND = """
from pxr import Usd, UsdGeom
from fabricusd.fabric import Binding
from fabricusd.schema import load, read_binding, write_binding, write_fabric
stage = Usd.Stage.CreateInMemory()
fabric = load("polyester_satin_charmeuse")
write_fabric(stage, "/Satin", fabric)
mesh = UsdGeom.Mesh.Define(stage, "/Shirt").GetPrim()
write_binding(mesh, "/Satin", Binding(fabric=fabric, uv_set=""))
assert read_binding(mesh).fabric.back == fabric.back
print(json.dumps(stage.GetRootLayer().ExportToString()))
"""


def test_a_binding_is_written_the_same():
    assert 'prepend apiSchemas = ["WovenBindingAPI"]' in in_both_orders(BIND)

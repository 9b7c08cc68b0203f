"""Which of several bindings a mesh or a subset wears."""

from __future__ import annotations

import pytest
from pxr import Usd, UsdGeom, UsdShade

from fabricusd.scene.scene import FabricSurface
from fabricusd.schema.source import PRESETS
from tests.reference.stages import new_stage, read, square

STRONG = UsdShade.Tokens.strongerThanDescendants


@pytest.fixture
def stage(tmp_path):
    """`/top/group/square`, and a UsdPreviewSurface `/looks/plain`."""
    made = new_stage(tmp_path)
    UsdGeom.Xform.Define(made, "/top")
    UsdGeom.Xform.Define(made, "/top/group")
    square(made, "/top/group/square")
    UsdShade.Material.Define(made, "/looks/plain")
    shader = UsdShade.Shader.Define(made, "/looks/plain/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    UsdShade.Material(made.GetPrimAtPath("/looks/plain")).CreateSurfaceOutput().ConnectToSource(
        shader.ConnectableAPI(), "surface"
    )
    return made


def fabric(stage: Usd.Stage, name: str) -> Usd.Prim:
    prim = stage.DefinePrim(f"/fabrics/{name}")
    prim.GetReferences().AddReference(str(PRESETS / "linen_plain.usda"))
    return prim


def wear(stage: Usd.Stage, path: str, name: str) -> Usd.Prim:
    """`fabric:binding` on a prim itself; no name takes the fabric off."""
    prim = stage.GetPrimAtPath(path)
    prim.ApplyAPI("WovenBindingAPI")
    targets = [fabric(stage, name).GetPath()] if name else []
    prim.GetRelationship("fabric:binding").SetTargets(targets)
    return prim


def material(stage: Usd.Stage, name: str) -> UsdShade.Material:
    """A material that carries a fabric."""
    made = UsdShade.Material.Define(stage, f"/looks/{name}")
    wear(stage, f"/looks/{name}", name)
    return made


def bind(stage: Usd.Stage, path: str, name: str, *, strength=None, purpose="", only="") -> None:
    """Bind material `name`, by a collection of `only` where that is given."""
    api = UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath(path))
    bound = UsdShade.Material(stage.GetPrimAtPath(f"/looks/{name}")) or material(stage, name)
    purpose = purpose or UsdShade.Tokens.allPurpose
    strength = strength or UsdShade.Tokens.fallbackStrength
    if not only:
        api.Bind(bound, strength, purpose)
        return
    collection = Usd.CollectionAPI.Apply(api.GetPrim(), name)
    collection.IncludePath(only)
    api.Bind(collection, bound, name, strength, purpose)


def worn(stage: Usd.Stage) -> str:
    scene = read(stage)
    assert scene.notes == []
    [mesh] = scene.meshes
    surface = scene.materials[mesh.material[0]]
    assert isinstance(surface, FabricSurface) == (surface.name not in ("grey", "/looks/plain"))
    return surface.name


MESH, GROUP, TOP = "/top/group/square", "/top/group", "/top"

CASES = {
    "the mesh's own binding": (lambda s: wear(s, MESH, "own"), "own"),
    "a material on the mesh": (lambda s: bind(s, MESH, "M"), "M"),
    "a material on an Xform": (lambda s: bind(s, TOP, "M"), "M"),
    "a collection": (lambda s: bind(s, TOP, "M", only=GROUP), "M"),
    "of the full purpose": (lambda s: bind(s, MESH, "M", purpose="full"), "M"),
    "of the preview purpose": (lambda s: bind(s, MESH, "M", purpose="preview"), "M"),
    "full before preview": (
        lambda s: (bind(s, MESH, "P", purpose="preview"), bind(s, MESH, "F", purpose="full")),
        "F",
    ),
    "a binding on an Xform": (lambda s: wear(s, TOP, "up"), "up"),
    "the nearer of two Xforms": (lambda s: (wear(s, TOP, "up"), wear(s, GROUP, "near")), "near"),
    "own binding before own material": (
        lambda s: (wear(s, MESH, "own"), bind(s, MESH, "M")),
        "own",
    ),
    "own binding before a material above": (
        lambda s: (wear(s, MESH, "own"), bind(s, TOP, "M")),
        "own",
    ),
    "a binding on an Xform before a material on it": (
        lambda s: (wear(s, GROUP, "up"), bind(s, GROUP, "M")),
        "up",
    ),
    "a material below a binding on an Xform": (
        lambda s: (wear(s, TOP, "up"), bind(s, GROUP, "M")),
        "M",
    ),
    "a plain material below a binding on an Xform": (
        lambda s: (wear(s, TOP, "up"), bind(s, MESH, "plain")),
        "/looks/plain",
    ),
    "a stronger material above": (
        lambda s: (bind(s, TOP, "M", strength=STRONG), bind(s, MESH, "N")),
        "M",
    ),
    "a stronger collection above": (
        lambda s: (bind(s, TOP, "M", strength=STRONG, only=MESH), bind(s, MESH, "N")),
        "M",
    ),
    "a stronger material above a binding on the mesh": (
        lambda s: (bind(s, TOP, "plain", strength=STRONG), wear(s, MESH, "own")),
        "/looks/plain",
    ),
    "a binding that is taken off": (lambda s: (wear(s, TOP, "up"), wear(s, MESH, "")), "grey"),
    "a binding that is taken off above a material": (
        lambda s: (wear(s, MESH, ""), bind(s, TOP, "M")),
        "M",
    ),
    "a material whose fabric is taken off": (
        lambda s: (bind(s, MESH, "plain"), wear(s, "/looks/plain", "")),
        "/looks/plain",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_a_mesh_wears(name, stage):
    author, expected = CASES[name]
    author(stage)
    assert worn(stage) == expected


def subset(stage: Usd.Stage) -> str:
    """A subset of the mesh's only face."""
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(MESH))
    one = UsdGeom.Subset.CreateGeomSubset(mesh, "part", UsdGeom.Tokens.face, [0], "materialBind")
    return str(one.GetPath())


OF_SUBSETS = {
    "a material that carries a fabric": (
        lambda s, part: (bind(s, MESH, "M"), bind(s, part, "N")),
        "N",
    ),
    "a collection that names it": (
        lambda s, part: (bind(s, MESH, "M"), bind(s, part, "N", only=part)),
        "N",
    ),
    "its mesh's material": (lambda s, part: bind(s, MESH, "M"), "M"),
    "its mesh's binding": (lambda s, part: wear(s, MESH, "own"), "own"),
    "a binding of the Xform above": (lambda s, part: wear(s, TOP, "up"), "up"),
    "its own binding before the mesh's": (
        lambda s, part: (wear(s, MESH, "own"), wear(s, part, "part")),
        "part",
    ),
    "nothing, which takes the mesh's off": (
        lambda s, part: (wear(s, MESH, "own"), wear(s, part, "")),
        "grey",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", OF_SUBSETS)
def test_a_subset_wears(name, stage):
    author, expected = OF_SUBSETS[name]
    author(stage, subset(stage))
    assert worn(stage) == expected


def test_a_material_is_laid_as_it_says(stage):
    carrier = material(stage, "M").GetPrim()
    carrier.GetAttribute("fabric:binding:threadsPerUnit").Set((8.0, 16.0))
    carrier.GetAttribute("fabric:binding:rotation").Set(30.0)
    bind(stage, MESH, "M")
    [surface] = read(stage).materials
    assert surface.binding.threads_per_uv == (8.0, 16.0)
    assert surface.binding.rotation == pytest.approx(0.5235987755982988)


def test_a_material_whose_fabric_cannot_be_read_shows_its_own_surface(stage):
    bind(stage, MESH, "plain")
    wear(stage, "/looks/plain", "linen").GetRelationship("fabric:binding").SetTargets(["/top"])
    scene = read(stage)
    assert scene.materials[0].name == "/looks/plain"
    assert scene.notes == [
        "/looks/plain fabric:binding targets /top, Xform; it must be a WovenFabric - rendered "
        "without a fabric"
    ]


def test_copies_of_one_instance_share_the_fabric_of_the_material_inside(tmp_path):
    stage = new_stage(tmp_path)
    square(stage, "/coat/square")
    made = UsdShade.Material.Define(stage, "/coat/silk")
    cloth = stage.DefinePrim("/coat/cloth")
    cloth.GetReferences().AddReference(str(PRESETS / "linen_plain.usda"))
    made.GetPrim().ApplyAPI("WovenBindingAPI")
    made.GetPrim().GetRelationship("fabric:binding").SetTargets([cloth.GetPath()])
    UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/coat/square")).Bind(made)
    for k in range(3):
        copy = stage.DefinePrim(f"/copy{k}")
        copy.GetReferences().AddInternalReference("/coat")
        copy.SetInstanceable(True)
    scene = read(stage)
    assert [m.name for m in scene.materials] == ["cloth"]
    assert len(scene.meshes) == 4
    assert scene.notes == []

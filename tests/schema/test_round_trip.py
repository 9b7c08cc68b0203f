"""prim -> Fabric -> prim loses nothing, however the prim was composed."""

from __future__ import annotations

from dataclasses import fields, replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pxr import Sdf, Usd, UsdGeom

from fabricusd.fabric import Binding, Fabric, Thread
from fabricusd.schema import (
    load,
    preset_names,
    read_binding,
    read_fabric,
    save,
    write_binding,
    write_fabric,
)
from fabricusd.schema.attributes import DEGREE, unscale
from fabricusd.schema.names import prim_name
from fabricusd.sides import Sides
from tests.strategies import fabrics


def assert_same(one: Fabric, other: Fabric) -> None:
    """Equal, with threads in the same order, which dict equality does not ask for."""
    assert one == other
    assert list(one.threads) == list(other.threads)


def named_apart(fabric: Fabric) -> Fabric:
    """The fabric, with a back that is not called as one of its threads."""
    if fabric.back is not None and fabric.back.name in fabric.threads:
        return replace(fabric, back=replace(fabric.back, name="Its_own_back"))
    return fabric


@given(fabrics(uneven=True))
def test_a_fabric_written_to_a_prim_reads_back_equal(fabric):
    fabric = named_apart(fabric)
    stage = Usd.Stage.CreateInMemory()
    assert_same(read_fabric(write_fabric(stage, f"/{fabric.name}", fabric)), fabric)


@given(fabrics(uneven=True))
def test_a_prim_read_and_written_again_is_the_same_text(fabric):
    first, second = Usd.Stage.CreateInMemory(), Usd.Stage.CreateInMemory()
    prim = write_fabric(first, "/Cloth", fabric)
    write_fabric(second, "/Cloth", read_fabric(prim))
    assert second.GetRootLayer().ExportToString() == first.GetRootLayer().ExportToString()


OTHER_VALUES = {
    "fabric:warp:threads": [1], "fabric:weft:threads": [1, 0],
    "fabric:warp:density": 7.0, "fabric:weft:density": 9.0,
    "fabric:warp:coverage": 0.25, "fabric:weft:coverage": 0.5,
    "fabric:weave:rows": ["110", "011"], "fabric:weave:name": "odd",
    "fabric:surfaceLaw": "projected",
    "fabric:model": "conserving", "fabric:opaque": True, "fabric:maskingWidth": 12.5,
    "fabric:sides:gap": [0.1], "fabric:sides:surface": [0.2], "fabric:sides:reflected": [0.3],
    "fabric:sides:transmitted": [0.4], "fabric:sides:forward": [0.5],
    "thread:albedo": (0.1, 0.2, 0.3), "thread:color": (0.3, 0.2, 0.1), "thread:ior": 1.7,
    "thread:isotropic": 0.9, "thread:gammaSurface": 3.0, "thread:gammaVolume": 6.0,
    "thread:surfaceGain": 0.125, "thread:model": "thesis", "thread:thickness": 0.75,
    "thread:linearDensity": 20.0,
    "thread:targetColor": (-0.1, 0.2, 0.3), "thread:targetColor:basis": "singleLayer",
    "thread:targetColor:observer": "10",
    "thread:curve:positions": [0.0, 0.0, 1.0], "thread:curve:angles": [-10.0, 20.0, 30.0],
    # Lengths come first: without them, what varies along the thread is refused.
    "thread:unevenness:length": 5.0, "thread:unevenness:cv": 0.2, "thread:unevenness:count": 0.1,
    "thread:unevenness:shade": 0.05, "thread:slub:spacing": 60.0, "thread:slub:length": 12.0,
    "thread:slub:amount": 0.5, "thread:plies": 2, "thread:hairiness": 2.5, "thread:twist": -450.0,
    "fabric:unevenness:seed": 3,
}  # fmt: skip


def test_every_property_of_the_schema_is_written_and_read():
    stage = Usd.Stage.CreateInMemory()
    dyed = Thread(target_basis="opaque")
    fabric = Fabric(threads={"A": dyed, "B": Thread()}, opaque=True, back=Fabric(name="Back"))
    sides = Sides(**{f.name: (0.45,) for f in fields(Sides)})
    fabric = replace(fabric, weave=replace(fabric.weave, name="plain"), sides=sides)
    fabric = replace(fabric, surface_law="unmasked")
    prim = write_fabric(stage, "/Cloth", fabric)
    for one in (prim, prim.GetChild("A")):
        schema = set(one.GetPrimDefinition().GetPropertyNames())
        assert set(one.GetAuthoredPropertyNames()) == schema
        assert schema - {"fabric:threads", "fabric:back"} <= set(OTHER_VALUES)
    prim.GetAttribute("fabric:opaque").Set(False)
    thread = prim.GetChild("A")
    thread.GetAttribute("thread:curve:positions").Set([0.0, 0.5, 1.0])
    thread.GetAttribute("thread:curve:angles").Set([0.0, 0.0, 0.0])
    for name, value in OTHER_VALUES.items():
        before = read_fabric(prim)
        (prim if name.startswith("fabric:") else thread).GetAttribute(name).Set(value)
        assert read_fabric(prim) != before, f"{name} is not read"


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd"])
@pytest.mark.parametrize("name", preset_names())
def test_a_preset_saved_to_a_file_loads_equal(name, suffix, tmp_path):
    fabric = load(name)
    save(fabric, tmp_path / f"cloth{suffix}")
    assert_same(load(tmp_path / f"cloth{suffix}"), fabric)


@given(st.integers(-900000, 900000))
def test_an_angle_typed_in_degrees_comes_back_as_typed(ten_thousandths):
    typed = ten_thousandths / 1e4
    assert unscale(typed * DEGREE, DEGREE) == typed


@given(st.floats(-3, 3))
def test_an_angle_no_degree_maps_to_moves_by_two_roundings_at_most(radians):
    assert unscale(radians, DEGREE) * DEGREE == pytest.approx(radians, rel=5e-16, abs=1e-300)


def test_referenced_threads_with_overrides_are_read_as_composed(tmp_path):
    save(load("linen_plain"), tmp_path / "linen.usda")
    (tmp_path / "shop.usda").write_text(
        """#usda 1.0
def WovenFabric "Dyed" (references = @linen.usda@)
{
    over "Linen"
    {
        color3d thread:albedo = (0.3, 0.1, 0.1)
    }
}
"""
    )
    fabric = load(tmp_path / "shop.usda")
    assert fabric.threads["Linen"].albedo == (0.3, 0.1, 0.1)
    assert fabric.threads["Linen"].ior == 1.46


def test_a_fabric_may_take_its_threads_from_elsewhere_in_the_stage(tmp_path):
    (tmp_path / "library.usda").write_text(
        """#usda 1.0
def WovenThread "Silk"
{
    double thread:ior = 1.345
}
def WovenFabric "Cloth"
{
    rel fabric:threads = </Silk>
}
"""
    )
    assert load(f"{tmp_path / 'library.usda'}:/Cloth").threads["Silk"].ior == 1.345


TWO_LIBRARIES = """#usda 1.0
def Scope "Library"
{
    def WovenThread "Silk"
    {
        double thread:ior = 1.345
    }
}
def WovenFabric "Cloth"
{
    rel fabric:threads = [</Cloth/Silk>, </Library/Silk>]
    int[] fabric:weft:threads = [1]
    def WovenThread "Silk"
    {
    }
}
"""


def test_threads_of_one_name_from_two_places_are_told_apart(tmp_path):
    (tmp_path / "two.usda").write_text(TWO_LIBRARIES)
    fabric = load(tmp_path / "two.usda")
    assert [(name, t.ior) for name, t in fabric.threads.items()] == [
        ("Silk", 1.5),
        ("Silk_2", 1.345),
    ]
    save(fabric, tmp_path / "again.usda")
    assert_same(load(tmp_path / "again.usda"), fabric)


@pytest.mark.parametrize("where", ["WovenFabric", "Scope"])
def test_an_instanceable_fabric_is_read(where, tmp_path):
    save(load("velvet"), tmp_path / "velvet.usda")
    inside = 'def WovenFabric "velvet" (references = @velvet.usda@)\n{\n}'
    library = f'def Scope "Library"\n{{\n{inside}\n}}'
    inner = where == "WovenFabric"
    target, name = ("</Library/velvet>", "velvet") if inner else ("</Library>", "Shop")
    (tmp_path / "shop.usda").write_text(
        f"""#usda 1.0
(
    defaultPrim = "{name}"
)
class {library[4:]}
def {where} "{name}" (
    instanceable = true
    references = {target}
)
{{
}}
"""
    )
    assert_same(load(tmp_path / "shop.usda"), load("velvet"))


ARCS = {
    "a reference": 'def "Cloth" (references = @f.usdc@</Front>)\n{\n}',
    "a payload": 'def "Cloth" (payload = @f.usdc@</Front>)\n{\n}',
    "a reference to a reference": 'def "A" (references = @f.usdc@</Front>)\n{\n}\n'
    'def "Cloth" (references = </A>)\n{\n}',
    "an inherited class": 'class "A" (references = @f.usdc@</Front>)\n{\n}\n'
    'def "Cloth" (inherits = </A>)\n{\n}',
    "a specialised class": 'class "A" (references = @f.usdc@</Front>)\n{\n}\n'
    'def "Cloth" (specializes = </A>)\n{\n}',
    "a variant": 'def "Cloth" (\nvariants = { string v = "on" }\nprepend variantSets = "v"\n)\n'
    '{\nvariantSet "v" = {\n"on" (references = @f.usdc@</Front>) {\n}\n}\n}',
    "an instance": 'def "Cloth" (\ninstanceable = true\nreferences = @f.usdc@</Front>\n)\n{\n}',
    "a sublayer with an over": '',
}  # fmt: skip


@pytest.mark.parametrize("arc", ARCS)
@settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(fabric=fabrics(uneven=True))
def test_no_arc_of_composition_loses_anything(arc, fabric, tmp_path):
    fabric = named_apart(fabric)
    save(replace(fabric, name="Front"), tmp_path / "f.usdc")
    head, name = '(\nsubLayers = [@f.usdc@]\n)\nover "Front"\n{\n}', "Front"
    if ARCS[arc]:
        head, name = ARCS[arc], "Cloth"
    (tmp_path / "shop.usda").write_text(f"#usda 1.0\n{head}\n")
    assert_same(load(f"{tmp_path / 'shop.usda'}:/{name}"), replace(fabric, name=name))


@pytest.mark.parametrize(("name", "written"), [("Cloth", "Cloth"), ("Silk", "Silk_2")])
def test_a_back_called_as_its_front_keeps_its_name_and_one_called_as_a_thread_does_not(
    name, written
):
    stage = Usd.Stage.CreateInMemory()
    fabric = Fabric(name="Cloth", threads={"Silk": Thread()}, back=Fabric(name=name, opaque=True))
    again = read_fabric(write_fabric(stage, "/Cloth", fabric))
    assert again == replace(fabric, back=replace(fabric.back, name=written))


@pytest.mark.parametrize(
    ("text", "name"),
    [("2229", "_2229"), ("4 black", "_4_black"), ("Größe", "Größe"), ("麻 布", "麻_布"),
     ("", "Fabric"), ("a²", "a_"), ("²", "_"), ("\udcff", "_")],
)  # fmt: skip
def test_a_prims_name_is_the_nearest_to_the_text(text, name):
    assert prim_name(text) == name
    assert prim_name(text, ascii_only=True).isascii()


def test_sublayers_payloads_and_variants_are_read_as_composed(tmp_path):
    save(load("velvet"), tmp_path / "velvet.usdc")
    (tmp_path / "asset.usda").write_text(
        """#usda 1.0
(
    defaultPrim = "Cloth"
)
def WovenFabric "Cloth" (
    payload = @velvet.usdc@
    variants = { string dye = "red" }
    prepend variantSets = "dye"
)
{
    variantSet "dye" = {
        "red" {
            over "Pile1"
            {
                color3d thread:albedo = (0.4, 0.01, 0.01)
            }
        }
        "blue" {
            over "Pile1"
            {
                color3d thread:albedo = (0.01, 0.01, 0.4)
            }
        }
    }
}
"""
    )
    (tmp_path / "shot.usda").write_text(
        """#usda 1.0
(
    defaultPrim = "Cloth"
    subLayers = [ @asset.usda@ ]
)
over "Cloth" (variants = { string dye = "blue" })
{
    double fabric:warp:density = 33
}
"""
    )
    assert load(tmp_path / "asset.usda").threads["Pile1"].albedo == (0.4, 0.01, 0.01)
    fabric = load(tmp_path / "shot.usda")
    assert fabric.threads["Pile1"].albedo == (0.01, 0.01, 0.4)
    assert fabric.warp.density == 3300
    assert fabric.opaque


@given(
    st.tuples(st.floats(0, 500), st.floats(0, 500)).filter(lambda t: (t[0] == 0) == (t[1] == 0)),
    st.integers(-180, 180),
)
def test_a_binding_written_to_a_mesh_reads_back_equal(threads_per_uv, turn):
    stage = Usd.Stage.CreateInMemory()
    fabric = load("linen_plain")
    write_fabric(stage, "/linen_plain", fabric)
    mesh = UsdGeom.Mesh.Define(stage, "/Shirt")
    st_primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray)
    st_primvar.Set([(0, 0)])
    binding = Binding(
        fabric=fabric,
        metres_per_uv=0.25,
        threads_per_uv=threads_per_uv,
        rotation=turn * DEGREE,
        offset=(0.25, -3.0),
    )
    write_binding(mesh.GetPrim(), "/linen_plain", binding)
    assert read_binding(mesh.GetPrim()) == binding


def test_a_back_that_names_its_front_is_read_once():
    stage = Usd.Stage.CreateInMemory()
    front = load("polyester_satin_charmeuse")
    prim = write_fabric(stage, "/Front", front)
    back = prim.GetChild("polyester_satin_charmeuse_back")
    back.CreateRelationship("fabric:back").SetTargets([prim.GetPath()])
    assert read_fabric(prim).back == front.back

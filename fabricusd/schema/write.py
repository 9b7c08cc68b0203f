"""Fabric -> prim, and Fabric -> file."""

from __future__ import annotations

import os
from collections.abc import Sequence

from pxr import Sdf, Usd, Vt

from fabricusd.errors import FabricError
from fabricusd.fabric import BASES, SURFACE_LAWS, Binding, Fabric, Thread
from fabricusd.files import whole_file
from fabricusd.schema import attributes
from fabricusd.schema.access import BINDING_API
from fabricusd.schema.attributes import DEGREE, Attribute, from_si, unscale
from fabricusd.schema.colors import LINEAR
from fabricusd.schema.names import free_name, prim_name
from fabricusd.schema.source import usd_errors
from fabricusd.sides import Sides
from fabricusd.weaves import rows as weave_rows

EXTENSIONS = (".usda", ".usdc", ".usd")


def save(fabric: Fabric, path: str | os.PathLike[str], *, clobber: bool = True) -> None:
    """Write a fabric as the default prim of a new layer, whole or not at all."""
    save_all([fabric], path, clobber=clobber)


def save_all(
    fabrics: Sequence[Fabric], path: str | os.PathLike[str], *, clobber: bool = True
) -> None:
    """Write fabrics as root prims of a new layer, the first as its default prim.

    Of fabrics that share a name, the first is written.
    """
    target = os.fspath(path)
    require_layer_name(target)
    export(_layer(fabrics), target, clobber=clobber)


def require_layer_name(path: str) -> None:
    """Raise FabricError for a name that has no suffix of a USD layer."""
    if not path.lower().endswith(EXTENSIONS):
        raise FabricError(path, f"has another suffix than {', '.join(EXTENSIONS)}")


def export(
    layer: Sdf.Layer, path: str | os.PathLike[str], *, clobber: bool = True, format: str = ""
) -> None:
    """Write any layer to `path`, whole or not at all; FabricError where it cannot be.

    format : "usda" or "usdc", of a .usd file; "" for what USD chooses
    """
    target = os.fspath(path)
    with usd_errors(target, "written"), whole_file(target, clobber=clobber) as temporary:
        told = {"format": format} if format and target.lower().endswith(".usd") else {}
        if not layer.Export(str(temporary), "", told):
            raise FabricError(target, "cannot be written")


def usd_text(fabric: Fabric) -> str:
    """What `save` writes into a .usda file."""
    return str(_layer([fabric]).ExportToString())


def _layer(fabrics: Sequence[Fabric]) -> Sdf.Layer:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    stage = Usd.Stage.Open(layer)
    for fabric in fabrics:
        path = Sdf.Path.absoluteRootPath.AppendChild(prim_name(fabric.name))
        if not stage.GetPrimAtPath(path):
            prim = write_fabric(stage, path, fabric)
            if not stage.HasDefaultPrim():
                stage.SetDefaultPrim(prim)
    # The layer has no geometry, but USD's validators want both on every layer.
    stage.SetMetadata("upAxis", "Y")
    stage.SetMetadata("metersPerUnit", 0.01)
    return layer


def sides_text(path: Sdf.Path | str, sides: Sides) -> str:
    """A layer of USD text that states `sides` over the WovenFabric prim at `path`."""
    return str(sides_layer(path, sides).ExportToString())


def sides_layer(path: Sdf.Path | str, sides: Sides) -> Sdf.Layer:
    """A layer that states `sides` over the WovenFabric prim at `path`, for stages to sublayer."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    stage = Usd.Stage.Open(layer)
    write_sides(stage.OverridePrim(Sdf.Path(path)), sides)
    return layer


def write_fabric(stage: Usd.Stage, path: Sdf.Path | str, fabric: Fabric) -> Usd.Prim:
    """Define a WovenFabric prim; its threads and its back are children, which a reference brings.

    A name that USD does not accept becomes the nearest one that it does. Threads that share a name,
    and a back with the name of a thread, get a number after theirs.
    """
    path = Sdf.Path(path)
    prim = stage.DefinePrim(path, "WovenFabric")
    _document(prim, fabric.documentation)
    names = _unique_names(list(fabric.threads))
    for name, thread in zip(names, fabric.threads.values(), strict=True):
        write_thread(stage, path.AppendChild(name), thread)
    prim.CreateRelationship("fabric:threads", custom=False).SetTargets(
        [path.AppendChild(name) for name in names]
    )
    for which, thread_set in (("warp", fabric.warp), ("weft", fabric.weft)):
        _set(prim, f"fabric:{which}:threads", "int[]", Vt.IntArray(thread_set.sequence))
        _set_numbers(prim, attributes.thread_set(which), thread_set)
    rows = weave_rows.from_cells(fabric.weave.cells)
    _set(prim, "fabric:weave:rows", "string[]", Vt.StringArray(rows))
    if fabric.weave.name:
        _set(prim, "fabric:weave:name", "string", fabric.weave.name)
    _set(prim, "fabric:model", "token", fabric.model)
    if fabric.surface_law != SURFACE_LAWS[0]:
        _set(prim, "fabric:surfaceLaw", "token", fabric.surface_law)
    if fabric.opaque:
        _set(prim, "fabric:opaque", "bool", True)
    _set_numbers(prim, attributes.FABRIC, fabric)
    write_sides(prim, fabric.sides)
    if fabric.back is not None:
        name = free_name(prim_name(fabric.back.name), names)
        back = write_fabric(stage, path.AppendChild(name), fabric.back)
        prim.CreateRelationship("fabric:back", custom=False).SetTargets([back.GetPath()])
    return prim


def write_thread(stage: Usd.Stage, path: Sdf.Path | str, thread: Thread) -> Usd.Prim:
    """Define a WovenThread prim."""
    prim = stage.DefinePrim(Sdf.Path(path), "WovenThread")
    _document(prim, thread.documentation)
    _set_numbers(prim, attributes.THREAD, thread)
    _set(prim, "thread:model", "token", thread.model or "inherit")
    if thread.target_basis != BASES[0]:
        _set(prim, "thread:targetColor:basis", "token", thread.target_basis)
        _set(prim, "thread:targetColor:observer", "token", str(thread.target_observer))
    angles = [unscale(a, DEGREE) for a in thread.curve.angles]
    _set(prim, "thread:curve:positions", "double[]", Vt.DoubleArray(thread.curve.positions))
    _set(prim, "thread:curve:angles", "double[]", Vt.DoubleArray(angles))
    return prim


def write_sides(prim: Usd.Prim, sides: Sides) -> None:
    """Write what `sides` states to a WovenFabric prim, or to an over of one."""
    for entry in attributes.SIDES:
        if stated := getattr(sides, entry.field):
            _set(prim, entry.name, entry.type_name, Vt.DoubleArray(stated))


def write_binding(prim: Usd.Prim, fabric_path: Sdf.Path | str, binding: Binding) -> None:
    """Apply WovenBindingAPI to a mesh or subset, bound to the WovenFabric prim at `fabric_path`."""
    # Not `ApplyAPI`, which asks for a schema that USD knows.
    prim.AddAppliedSchema(BINDING_API)
    prim.CreateRelationship("fabric:binding", custom=False).SetTargets([Sdf.Path(fabric_path)])
    _set(prim, "fabric:binding:uvSet", "token", binding.uv_set)
    _set_numbers(prim, attributes.BINDING, binding)


def _unique_names(names: Sequence[str]) -> list[str]:
    """Return valid prim names, with a number after each that repeats an earlier one."""
    taken: dict[str, None] = {}
    for name in names:
        taken[free_name(prim_name(name), taken)] = None
    return list(taken)


def _document(prim: Usd.Prim, text: str) -> None:
    if text:
        prim.SetDocumentation(text)


def _set_numbers(prim: Usd.Prim, table: tuple[Attribute, ...], owner: object) -> None:
    for entry in table:
        if entry.field == "target_color" and getattr(owner, "target_basis", "") == BASES[0]:
            continue
        _set(prim, entry.name, entry.type_name, from_si(getattr(owner, entry.field), entry))


def _set(prim: Usd.Prim, name: str, type_name: str, value: object) -> None:
    kind = Sdf.ValueTypeNames.Find(type_name)
    # Fabrics are read at one time only, and say so.
    uniform = Sdf.VariabilityUniform
    attribute = prim.CreateAttribute(name, kind, custom=False, variability=uniform)
    attribute.Set(value)
    if type_name.startswith("color"):
        attribute.SetColorSpace(LINEAR)

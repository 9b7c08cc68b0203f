"""A garment out of its look: one layer without references, variants, instances or collections.

Many readers of packages compose none of these, and know no fabrics.
"""

from __future__ import annotations

from collections.abc import Collection

from pxr import Kind, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from fabricusd.schema.access import BINDING_API, TYPES

SCOPE = "FabricLooks"
"""Scope of a look's materials, below each root prim."""

_LIGHTS = (UsdLux.BoundableLightBase, UsdLux.NonboundableLightBase)


def flat_garment(stage: Usd.Stage) -> Sdf.Layer:
    """What wears a look on `stage`, with all that it needs; the whole stage where nothing does.

    That is each mesh with a material of the look, or the component model that the mesh is part of.
    """
    _take_instances_apart(stage)
    layer = stage.Flatten(addSourceFileComment=False)
    flat = Usd.Stage.Open(layer)
    bound = _bound_materials(flat)
    garments = {_garment(mesh) for mesh, material in bound.items() if _is_of_look(material)}
    # In every package: bindings that need no collection, and nothing that names a fabric.
    _bind_directly(flat, bound)
    if garments:
        _keep(flat, _with_all_they_name(flat, garments))
    _remove_fabrics(flat)
    return layer


def _take_instances_apart(stage: Usd.Stage) -> None:
    """Make every instance on the stage an ordinary prim, in the stage's session layer."""
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        while True:
            found = [prim for prim in stage.Traverse() if prim.IsInstance()]
            for prim in found:
                prim.SetInstanceable(False)
            if not found:
                return


def _bound_materials(stage: Usd.Stage) -> dict[Usd.Prim, UsdShade.Material]:
    """The material of each mesh, and of each subset that has another one than its mesh."""
    found: dict[Usd.Prim, UsdShade.Material] = {}
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.Subset):
            api = UsdShade.MaterialBindingAPI(prim)
            material = api.ComputeBoundMaterial(UsdShade.Tokens.full)[0]
            material = material or api.ComputeBoundMaterial(UsdShade.Tokens.preview)[0]
            of_mesh = found.get(prim.GetParent()) if prim.IsA(UsdGeom.Subset) else None
            if material and (of_mesh is None or of_mesh.GetPath() != material.GetPath()):
                found[prim] = material
    return found


def _is_of_look(material: UsdShade.Material) -> bool:
    return any(path.name == SCOPE for path in material.GetPath().GetPrefixes())


def _garment(prim: Usd.Prim) -> Sdf.Path:
    """The component model that a mesh or subset is part of, or else the mesh alone."""
    above = prim
    while above and not above.IsPseudoRoot():
        if Kind.Registry.IsA(Usd.ModelAPI(above).GetKind(), Kind.Tokens.component):
            return above.GetPath()
        above = above.GetParent()
    return prim.GetParent().GetPath() if prim.IsA(UsdGeom.Subset) else prim.GetPath()


def _bind_directly(stage: Usd.Stage, bound: dict[Usd.Prim, UsdShade.Material]) -> None:
    for prim in stage.TraverseAll():
        remove_properties(prim, ("material:binding", "collection:"))
        remove_schemas(prim, ("MaterialBindingAPI", "CollectionAPI"))
    for prim, material in bound.items():
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def _with_all_they_name(stage: Usd.Stage, garments: Collection[Sdf.Path]) -> set[Sdf.Path]:
    """Paths of garments, and of all that relationships and connections in them lead to."""
    kept: set[Sdf.Path] = set()
    waiting = list(garments)
    for path in garments:
        # A skeleton is often named above what it moves.
        for above in path.GetPrefixes():
            for rel in stage.GetPrimAtPath(above).GetRelationships():
                if rel.GetName().startswith("skel:"):
                    waiting += [target.GetPrimPath() for target in rel.GetTargets()]
    while waiting:
        path = waiting.pop()
        if any(path.HasPrefix(one) for one in kept):
            continue
        kept.add(path)
        prim = stage.GetPrimAtPath(path)
        for one in Usd.PrimRange(prim, Usd.PrimAllPrimsPredicate) if prim else ():
            for rel in one.GetRelationships():
                waiting += [target.GetPrimPath() for target in rel.GetTargets()]
            for attribute in one.GetAttributes():
                waiting += [source.GetPrimPath() for source in attribute.GetConnections()]
    return kept


def _keep(stage: Usd.Stage, kept: set[Sdf.Path]) -> None:
    """Remove all prims but `kept`, what is below them, and what they are below; and what shines or
    looks on."""

    def is_kept(path: Sdf.Path) -> bool:
        return any(path.HasPrefix(one) or one.HasPrefix(path) for one in kept)

    gone = []
    walk = iter(Usd.PrimRange(stage.GetPseudoRoot(), Usd.PrimAllPrimsPredicate))
    for prim in walk:
        seen = not any(prim.IsA(kind) for kind in (UsdGeom.Camera, *_LIGHTS))
        if not prim.IsPseudoRoot() and not (is_kept(prim.GetPath()) and seen):
            gone.append(prim.GetPath())
            walk.PruneChildren()
    for path in gone:
        stage.RemovePrim(path)


def _remove_fabrics(stage: Usd.Stage) -> None:
    for prim in list(stage.TraverseAll()):
        if prim and prim.GetTypeName() in TYPES:
            stage.RemovePrim(prim.GetPath())
    for prim in stage.TraverseAll():
        remove_properties(prim, ("fabric:", "thread:"))
        remove_schemas(prim, (BINDING_API,))
        # The package is another asset than what it was made of.
        prim.ClearMetadata("assetInfo")
        for rel in prim.GetAuthoredRelationships():
            known = [target for target in rel.GetTargets() if stage.GetObjectAtPath(target)]
            if rel.HasAuthoredTargets() and not known:
                prim.RemoveProperty(rel.GetName())
    bound = {one.GetPath() for one in _bound_materials(stage).values()}
    for prim in list(stage.TraverseAll()):
        if prim and prim.IsA(UsdShade.Material) and prim.GetPath() not in bound:
            stage.RemovePrim(prim.GetPath())
    for prim in reversed(list(stage.TraverseAll())):
        if prim.GetTypeName() == "Scope" and not prim.GetAllChildren():
            stage.RemovePrim(prim.GetPath())


def remove_properties(prim: Usd.Prim, begin: tuple[str, ...]) -> None:
    """Drop the properties whose names begin with one of `begin`."""
    for name in prim.GetAuthoredPropertyNames():
        if name.startswith(begin):
            prim.RemoveProperty(name)


def remove_schemas(prim: Usd.Prim, names: tuple[str, ...]) -> None:
    """Drop applied schemas; `RemoveAppliedSchema` would leave a list of what is deleted."""
    given = prim.GetMetadata("apiSchemas")
    if given is None:
        return
    kept = [one for one in given.GetAppliedItems() if one.partition(":")[0] not in names]
    if kept:
        prim.SetMetadata("apiSchemas", Sdf.TokenListOp.Create(prependedItems=kept))
    else:
        prim.ClearMetadata("apiSchemas")

"""Which fabric, or else which material, a mesh or a subset of its faces is bound to.

`fabric:binding` stands on the prim itself, on a prim above it, or on the material that USD binds
there. docs/decisions/012-binding.md gives the order of the three.
"""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Sdf, Usd, UsdGeom, UsdShade

from fabricusd.schema.access import applies_binding, unbinds
from fabricusd.schema.rules.binding import place_problem

PURPOSES = (UsdShade.Tokens.full, UsdShade.Tokens.preview)
"""Material purposes in the order in which they are looked for; each falls back on bindings without
a purpose."""


@dataclass(frozen=True, kw_only=True)
class Bound:
    """What a prim is bound to.

    owner : the prim, or one above it, whose `fabric:binding` counts; None where no fabric is bound
        so, or a material outdoes it
    material : the material that USD binds; None where there is none
    relationship : the one that binds the material
    purpose : of that relationship, "" for all purposes
    """

    owner: Usd.Prim | None
    material: UsdShade.Material | None
    relationship: Usd.Relationship | None
    purpose: str = ""

    @property
    def fabrics(self) -> list[Usd.Prim]:
        """Prims whose `fabric:binding` names a fabric, the one that counts first."""
        found = [] if self.owner is None else [self.owner]
        if self.material is not None and names_fabric(self.material.GetPrim()):
            found.append(self.material.GetPrim())
        return found

    @property
    def place(self) -> str:
        """The path of what decides, the same for a mesh and a subset that says nothing itself."""
        if self.owner is not None:
            return str(self.owner.GetPath())
        return "" if self.relationship is None else str(self.relationship.GetPath())

    def is_bound_as(self, other: Bound) -> bool:
        """Whether one relationship binds the material of both, or neither has any."""
        ours, theirs = self.relationship, other.relationship
        if ours is None or theirs is None:
            return ours is theirs
        return bool(ours.GetPath() == theirs.GetPath())


def bound(prim: Usd.Prim) -> Bound:
    """What the mesh or subset `prim` is bound to."""
    material, relationship, purpose = _material(prim)
    owner = _owner(prim)
    if owner is not None and relationship is not None:
        at = relationship.GetPrim()
        if prim.IsA(UsdGeom.Subset) and not _is_of_mesh(prim, relationship):
            # Wherever the collection stands that names the subset and not its mesh.
            at = prim
        if _outdoes(relationship, at.GetPath(), owner.GetPath()):
            owner = None
    return Bound(owner=owner, material=material, relationship=relationship, purpose=purpose)


def names_fabric(prim: Usd.Prim) -> bool:
    """Whether a prim says which fabric is worn, rightly or not."""
    return applies_binding(prim) and not unbinds(prim)


def _owner(prim: Usd.Prim) -> Usd.Prim | None:
    """The nearest of `prim` and the prims above it that names a fabric; None where a binding
    without a target is nearer."""
    while prim and not prim.IsPseudoRoot():
        if names_fabric(prim) and not place_problem(prim):
            return prim
        if unbinds(prim):
            return None
        prim = prim.GetParent()
    return None


def _material(
    prim: Usd.Prim,
) -> tuple[UsdShade.Material | None, Usd.Relationship | None, str]:
    api = UsdShade.MaterialBindingAPI(prim)
    for purpose in PURPOSES:
        material, relationship = api.ComputeBoundMaterial(purpose)
        if material:
            # material:binding:PURPOSE, or material:binding:collection:PURPOSE:NAME.
            words = relationship.SplitName()
            is_own = purpose in (words[2:3] if len(words) == 3 else words[3:-1])
            return material, relationship, str(purpose) if is_own else ""
    return None, None, ""


def _is_of_mesh(subset: Usd.Prim, relationship: Usd.Relationship) -> bool:
    """Whether the relationship that binds a subset's material binds that of its mesh."""
    whole = _material(subset.GetParent())[1]
    return whole is not None and bool(whole.GetPath() == relationship.GetPath())


def _outdoes(relationship: Usd.Relationship, at: Sdf.Path, owner: Sdf.Path) -> bool:
    """Whether a material that is bound at `at` counts rather than `fabric:binding` on `owner`: the
    nearer one does, and one that is stronger than what lies below it."""
    if at == owner:
        return False
    if at.HasPrefix(owner):
        return True
    strength = UsdShade.MaterialBindingAPI.GetMaterialBindingStrength(relationship)
    return bool(strength == UsdShade.Tokens.strongerThanDescendants)

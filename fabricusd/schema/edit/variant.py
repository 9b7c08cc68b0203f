"""A variant of a fabric that values are set in."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

from pxr import Sdf, Usd

from fabricusd.errors import FabricError, one_line

VARIANTS = "fabricVariant"
"""The variant set of variants that name no set."""

ORIGINAL = "original"
"""The variant that keeps the values from before the first variant was made."""


class Variant:
    """A variant of `prim`, and selected; a new one begins as a copy of the one selected before.

    text : NAME, or SET=NAME
    """

    def __init__(self, *, prim: Usd.Prim, text: str) -> None:
        self.set_name, self.name = names_of(text)
        self.prim = prim
        self.variants = prim.GetVariantSets().AddVariantSet(self.set_name)
        if not self.variants.GetVariantNames():
            self.variants.AddVariant(ORIGINAL)
        if self.name not in self.variants.GetVariantNames():
            self._begin_as_a_copy()
        self.variants.SetVariantSelection(self.name)

    def _begin_as_a_copy(self) -> None:
        """Make the variant, with what the layer holds of the one that is selected."""
        before = self.variants.GetVariantSelection() or self.variants.GetVariantNames()[0]
        self.variants.AddVariant(self.name)
        layer = self.prim.GetStage().GetRootLayer()
        old, new = (
            self.prim.GetPath().AppendVariantSelection(self.set_name, name)
            for name in (before, self.name)
        )
        if layer.GetObjectAtPath(old):
            Sdf.CopySpec(layer, old, layer, new)

    def edit(self) -> AbstractContextManager[Any]:
        """A block in which values go into the variant."""
        context: AbstractContextManager[Any] = self.variants.GetVariantEditContext()
        return context

    def make_room(self, prim: Usd.Prim, name: str) -> None:
        """Move what the layer states of a property outside of variants into the other variants.

        An opinion of the layer itself is stronger than one in its variants.
        """
        layer = prim.GetStage().GetRootLayer()
        stated = layer.GetPropertyAtPath(prim.GetPath().AppendProperty(name))
        if not stated:
            return
        for other in self.variants.GetVariantNames():
            inside = self.prim.GetPath().AppendVariantSelection(self.set_name, other)
            path = prim.GetPath().ReplacePrefix(self.prim.GetPath(), inside)
            if other == self.name or layer.GetPropertyAtPath(path.AppendProperty(name)):
                continue
            Sdf.CreatePrimInLayer(layer, path)
            Sdf.CopySpec(layer, stated.path, layer, path.AppendProperty(name))
        del stated.owner.properties[name]


def names_of(text: str) -> tuple[str, str]:
    """(variant set, variant) of NAME or SET=NAME; FabricError for what is no name."""
    chosen, _, name = text.rpartition("=")
    chosen = chosen or VARIANTS
    for word in (chosen, name):
        # A variant's name may begin with a digit.
        if not word or not Sdf.Path.IsValidIdentifier(f"_{word}"):
            raise FabricError(
                f"--variant '{one_line(text, 60)}'",
                "is not a name; it must be letters, digits and _",
            )
    return chosen, name

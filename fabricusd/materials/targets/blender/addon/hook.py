"""Restore the looks of any USD file that Blender imports."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from .build import build, materials_by_path
from .looks import LookError, read

HAS_USD = hasattr(bpy.types, "USDHook")
"""Whether this Blender was built with USD. Those that Linux distributions build may not be."""

_waiting: list[dict[str, Any]] = []
"""What an import of ours is told, instead of the hook's own work."""


@contextmanager
def told() -> Iterator[dict[str, Any]]:
    """Yield the dictionary that gets what Blender made of each prim; the hook does nothing else.

    It stays empty where Blender cannot say it, as in the bpy wheel.
    """
    names: dict[str, Any] = {}
    _waiting.append(names)
    try:
        yield names
    finally:
        _waiting.pop()


def rebuild_all(stage: Any, prim_map: Any = None) -> int:
    """Rebuild the materials of `stage` that Blender imported; return their number."""
    try:
        looks = read(stage)
    except LookError as error:
        print(f"fabricusd looks: {stage.GetRootLayer().identifier} {error}")
        return 0
    # Earlier imports may have materials of the same names.
    found = materials_by_path(looks, prim_map or {}, () if prim_map else bpy.data.materials)
    made = build(looks, found)
    for line in made.left_out:
        print(f"fabricusd looks: left out {line}")
    return sum(map(len, made.groups.values()))


class FabricLooks(bpy.types.USDHook if HAS_USD else object):  # type: ignore[misc]
    """Rebuilds fabric materials after an import."""

    bl_idname = "fabricusd_looks"
    bl_label = "fabricusd looks"
    bl_description = "Restores lobes, anisotropy, sheen and light through baked fabrics"

    @staticmethod
    def on_import(import_context: Any) -> bool:
        """Rebuild materials; Blender calls this after importing a USD file."""
        try:
            # Blender ships USD's Python modules, the bpy wheel does not. Without them get_stage
            # would abort; with those of another USD build it would return an unknown type.
            import pxr.UsdShade  # noqa: F401

            names: Any = getattr(import_context, "get_prim_map", dict)()
            if _waiting:
                _waiting[-1].update(names)
                return True
            stage = import_context.get_stage()
        except (ImportError, TypeError):
            if not _waiting:
                print("fabricusd looks: USD's modules are missing; use File > Import > fabricusd")
            return False
        return rebuild_all(stage, names) >= 0


def register() -> None:
    """Register the hook, where there is an import to hook into."""
    if HAS_USD:
        bpy.utils.register_class(FabricLooks)


def unregister() -> None:
    """Unregister the hook."""
    if HAS_USD:
        bpy.utils.unregister_class(FabricLooks)

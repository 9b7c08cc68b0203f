"""Blender add-on: imports a fabricusd look with its garment, surfaces and dome light.

`fabricusd blender-addon FILE.zip` packs this folder. It is an extension of Blender 4.2 or later,
and an add-on of the earlier kind as well. It needs bpy and the USD modules that Blender brings,
and nothing of fabricusd outside this folder.

    looks        read a look from USD, without Blender
    images       textures from files and from packages
    nodes        node trees, node by node
    principled   the group of a fitted Principled BSDF
    lobes        the group of a sum of tilted lobes
    threads      what a look says of single threads, without Blender
    near         the lobes of the texel under a point
    distance     how many threads a pixel spans
    build        give Blender's materials the groups of a stage
    world        the dome light
    hook         do so after any USD import
    operator     File > Import > fabricusd look
"""

from __future__ import annotations

bl_info = {
    "name": "fabricusd looks",
    "author": "fabricusd authors",
    "version": (1, 3, 1),
    "blender": (4, 2, 0),
    "location": "File > Import > fabricusd look (.usda, .usdz)",
    "category": "Import-Export",
    "description": "Imports looks of woven cloth with their fitted surfaces",
}


def register() -> None:
    """Register the operator, its menu entry and the hook."""
    # Here, so that `looks` can be read by programs without Blender.
    from . import hook, operator

    operator.register()
    hook.register()


def unregister() -> None:
    """Take back what `register` did."""
    from . import hook, operator

    hook.unregister()
    operator.unregister()

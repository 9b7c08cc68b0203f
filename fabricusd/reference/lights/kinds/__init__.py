"""The kinds of light, one file each, found by themselves.

A kind is a module with

    KIND        its number, as in `scene.scene`
    fill        (row, light, axes): its columns of a row, besides those that all lights share
    irradiance  (row, dome, places): how brightly it lights these places, to share out samples
    sample      (light, dome, begin, end, block): directions to it, a kernel, see `hit_block`
    meet        (light, dome, size, block): what rays see of it, a kernel, see `ray_block`
"""

from __future__ import annotations

import pkgutil
from importlib import import_module
from types import ModuleType

from fabricusd.scene import light_kinds

_PARTS = ("fill", "irradiance", "sample", "meet")


def _find() -> dict[int, ModuleType]:
    found: dict[int, ModuleType] = {}
    for info in pkgutil.iter_modules(__path__):
        module = import_module(f"{__name__}.{info.name}")
        missing = [part for part in ("KIND", *_PARTS) if not hasattr(module, part)]
        if missing:
            raise ImportError(f"{module.__name__} has no {', '.join(missing)}")
        if module.KIND in found:
            raise ImportError(f"{module.__name__} and {found[module.KIND].__name__} are one kind")
        found[module.KIND] = module
    forgotten = [kind.name for number, kind in enumerate(light_kinds.KINDS) if number not in found]
    if forgotten:
        raise ImportError(f"{__name__} has no module for the lights {', '.join(forgotten)}")
    return dict(sorted(found.items()))


KINDS = _find()
"""Number of a kind -> its module."""

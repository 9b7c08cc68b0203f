"""The kinds of light, one module each; every module in this folder is registered.

A kind is a module with

    KIND        the kind's number, as in `scene.light_kinds`
    fill        (row, light, axes): fills the columns of a row that not all lights share
    irradiance  (row, dome, places): how brightly the light lights these places
    sample      (light, dome, begin, end, block): kernel that samples directions, see `hit_block`
    meet        (light, dome, size, block): kernel that adds what rays see, see `ray_block`
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
            raise ImportError(
                f"{module.__name__} and {found[module.KIND].__name__} have the same KIND"
            )
        found[module.KIND] = module
    forgotten = [kind.name for number, kind in enumerate(light_kinds.KINDS) if number not in found]
    if forgotten:
        raise ImportError(f"{__name__} has no module for the lights {', '.join(forgotten)}")
    return dict(sorted(found.items()))


KINDS = _find()
"""Number of a kind -> its module."""

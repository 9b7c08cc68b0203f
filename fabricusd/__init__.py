"""fabricusd: woven cloth as USD prims, rendered for review and baked for every other tool.

Importing this module imports neither USD nor Embree; the functions below load what they need.
"""

from __future__ import annotations

from importlib import import_module, metadata
from typing import Any

try:
    __version__ = metadata.version("fabricusd")
except metadata.PackageNotFoundError:  # a folder on the path that nobody installed
    __version__ = "0+unknown"

_WHERE = {
    "Fabric": "fabricusd.fabric",
    "Thread": "fabricusd.fabric",
    "ThreadSet": "fabricusd.fabric",
    "Weave": "fabricusd.fabric",
    "TangentCurve": "fabricusd.fabric",
    "Binding": "fabricusd.fabric",
    "FabricError": "fabricusd.errors",
    "load": "fabricusd.schema",
    "save": "fabricusd.schema",
    "check": "fabricusd.schema",
    "render": "fabricusd.reference",
    "material": "fabricusd.api",
    "fit": "fabricusd.api",
}

_CALLED = ("bake", "preview")
"""Folders of the package that are functions too, see `callable_module`."""

__all__ = [*_WHERE, *_CALLED, "__version__"]


def __getattr__(name: str) -> Any:
    if name in _WHERE:
        return getattr(import_module(_WHERE[name]), name)
    if name in _CALLED:
        return import_module(f"fabricusd.{name}")
    raise AttributeError(f"module 'fabricusd' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)

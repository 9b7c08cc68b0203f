"""Fabrics as USD prims: the schema, reading, writing, checking, presets, weave importers.

Importing this package registers the schema with USD. If the program has used a stage before,
fabricusd works all the same, but USD itself lacks the fallbacks, unless PXR_PLUGINPATH_NAME names
`PLUGIN_PATH`.
"""

from __future__ import annotations

from fabricusd.schema.plugin import FOLDER as PLUGIN_PATH
from fabricusd.schema.plugin import register

register()

from fabricusd.schema.check import Finding, check  # noqa: E402
from fabricusd.schema.read import load, read_binding, read_fabric  # noqa: E402
from fabricusd.schema.source import find_fabric, open_stage, preset_names, published_names  # noqa: E402
from fabricusd.schema.write import (  # noqa: E402
    export,
    save,
    save_all,
    write_binding,
    write_fabric,
)

__all__ = [
    "PLUGIN_PATH",
    "Finding",
    "check",
    "export",
    "find_fabric",
    "load",
    "open_stage",
    "preset_names",
    "published_names",
    "read_binding",
    "read_fabric",
    "save",
    "save_all",
    "write_binding",
    "write_fabric",
]

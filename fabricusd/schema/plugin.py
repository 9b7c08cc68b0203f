"""Registers the codeless schema and the validators with USD.

USD builds its table of prim definitions once, when the first one is asked for; a schema that is
registered later stays unknown without a word. So this runs when `fabricusd.schema` is imported, and
`require_schema` says so in plain words where it came too late.
"""

from __future__ import annotations

from pathlib import Path

from pxr import Plug, Usd

from fabricusd.errors import FabricError

FOLDER = Path(__file__).resolve().parent / "plugin"
"""What PXR_PLUGINPATH_NAME must contain for other tools to find the schema."""


def register() -> None:
    """Make the schema and the validators known to this process; again does nothing."""
    Plug.Registry().RegisterPlugins(str(FOLDER))


def require_schema() -> None:
    """Raise FabricError where USD does not know the schema."""
    if Usd.SchemaRegistry().FindConcretePrimDefinition("Fabric") is None:
        raise FabricError(
            "the USD schema",
            "was registered after USD had read its prim definitions; import fabricusd.schema "
            f"before the first stage is opened, or set PXR_PLUGINPATH_NAME={FOLDER}",
        )

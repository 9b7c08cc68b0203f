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

VALIDATORS = FOLDER / "validators"
"""The plugin of the rules. Not part of `FOLDER`: in a program whose Python has no fabricusd, USD
would fail to import it, and with it every validation there."""


def register() -> None:
    """Make the schema and the validators known to this process; again does nothing."""
    Plug.Registry().RegisterPlugins([str(FOLDER), str(VALIDATORS)])


def require_schema() -> None:
    """Raise FabricError where USD does not know the schema."""
    if Usd.SchemaRegistry().FindConcretePrimDefinition("Fabric") is None:
        raise FabricError(
            "the USD schema",
            "was registered after USD had read its prim definitions; import fabricusd.schema "
            f"before the first stage is opened, or set PXR_PLUGINPATH_NAME={FOLDER}",
        )

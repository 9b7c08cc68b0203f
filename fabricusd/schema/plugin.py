"""Registers the codeless schema and the validators with USD.

It runs when `fabricusd.schema` is imported. USD builds its table of prim definitions once, when the
first one is asked for, and a schema that is registered later stays unknown to it: `access` is how
fabricusd itself does without.
"""

from __future__ import annotations

from pathlib import Path

from pxr import Plug

FOLDER = Path(__file__).resolve().parent / "plugin"
"""What PXR_PLUGINPATH_NAME must contain for other tools to find the schema."""

VALIDATORS = FOLDER / "validators"
"""The plugin of the rules. Not part of `FOLDER`: in a program whose Python has no fabricusd, USD
would fail to import it, and with it every validation there."""


def register() -> None:
    """Make the schema and the validators known to this process; again does nothing."""
    Plug.Registry().RegisterPlugins([str(FOLDER), str(VALIDATORS)])

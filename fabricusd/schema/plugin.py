"""Registers the codeless schema and the validators with USD.

Importing `fabricusd.schema` does so. USD builds its table of prim definitions once, when the first
definition is asked for, and never learns of a schema that is registered later. fabricusd itself
does not need that table: it reads prims through `access`.
"""

from __future__ import annotations

import warnings
from pathlib import Path

from fabricusd.errors import FabricWarning
from fabricusd.host import VALIDATORS_FROM, require_usd, require_version, two_meet

require_usd()

from pxr import Plug, Usd  # noqa: E402

FOLDER = Path(__file__).resolve().parent / "plugin"
"""What PXR_PLUGINPATH_NAME must contain for other tools to find the schema."""

VALIDATORS = FOLDER / "validators"
"""The plugin of the rules. It is not part of what `FOLDER` includes: in a program whose Python has
no fabricusd, USD could not import it, and every validation there would fail."""


def register() -> None:
    """Make the schema and the validators known to this process; again does nothing.

    NoUsd where USD is too old. A FabricWarning where two USDs meet.
    """
    version = Usd.GetVersion()
    require_version(version)
    meeting = two_meet()
    if meeting:
        warnings.warn(meeting, FabricWarning, stacklevel=3)
    folders = [FOLDER, VALIDATORS] if version[1:] >= VALIDATORS_FROM else [FOLDER]
    Plug.Registry().RegisterPlugins([str(folder) for folder in folders])

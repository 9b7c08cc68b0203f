"""Registers the codeless schema and the validators with USD.

It runs when `fabricusd.schema` is imported. USD builds its table of prim definitions once, when the
first one is asked for, and a schema that is registered later stays unknown to it: `access` is how
fabricusd itself does without.
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
"""The plugin of the rules. Not part of `FOLDER`: in a program whose Python has no fabricusd, USD
would fail to import it, and with it every validation there."""


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

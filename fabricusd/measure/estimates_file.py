"""A fitted fabric as a USD layer that says of each number where it is from."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence

from fabricusd.fabric import Fabric

Measured = Mapping[str, tuple[float, float, float, str, str]]
"""Label -> (value, low, high, unit, source); low and high end the 95 % interval."""


def _key(label: str) -> str:
    """`warp A red` -> `warpARed`: `customData` nests at a colon, and texts read best unquoted."""
    words: list[str] = re.findall(r"[A-Za-z0-9]+", label)
    return words[0] + "".join(w[0].upper() + w[1:] for w in words[1:])


def save_measured(
    fabric: Fabric,
    measured: Measured,
    path: str | os.PathLike[str],
    *,
    photograph: str,
    notes: Sequence[str] = (),
    clobber: bool = True,
) -> None:
    """Write the fabric, whole or not at all; its `customData` holds `measured` and `notes`."""
    from pxr import Sdf

    from fabricusd.schema.write import export, usd_text

    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(usd_text(fabric))
    prim = layer.GetPrimAtPath(f"/{layer.defaultPrim}")
    names = ("value", "low", "high", "unit", "source")
    prim.customData = {
        "fabricusd": {
            "measured": {
                _key(label): dict(zip(names, each, strict=True)) for label, each in measured.items()
            },
            "photograph": photograph,
            "notes": "\n".join(notes),
        }
    }
    export(layer, os.fspath(path), clobber=clobber)

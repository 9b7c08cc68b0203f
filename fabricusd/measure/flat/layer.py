"""The recovered fabric as a USD layer that says of each number where it is from."""

from __future__ import annotations

import os
import re

from fabricusd.measure.flat.fit import Flat


def _key(label: str) -> str:
    """`warp A red` -> `warpARed`."""
    words = re.findall(r"[A-Za-z0-9]+", label)
    return words[0] + "".join(w[0].upper() + w[1:] for w in words[1:])


def save_flat(flat: Flat, path: str | os.PathLike[str], *, clobber: bool = True) -> None:
    """Write the fabric, whole or not at all; `customData` holds values, intervals and sources."""
    from pxr import Sdf

    from fabricusd.schema.write import export, usd_text

    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(usd_text(flat.fabric))
    prim = layer.GetPrimAtPath(f"/{layer.defaultPrim}")
    measured = {
        _key(v.label): {
            "value": v.value, "low": v.low, "high": v.high, "unit": v.unit, "source": v.source,
        }
        for v in flat.values
    }  # fmt: skip
    prim.customData = {
        "fabricusd": {
            "measured": measured, "photograph": os.path.basename(flat.front.name),
            "notes": "\n".join(flat.notes),
        }
    }  # fmt: skip
    export(layer, path, clobber=clobber)

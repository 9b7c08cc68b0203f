"""The fabric that a page asks for: one that is open, with the page's changes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric, Weave
from fabricusd.preview.page.threads import with_numbers
from fabricusd.preview.serve.said import number
from fabricusd.weaves import rows

MOST_CELLS = 1 << 18
"""Cells of the largest weave that is served: 512 ends by 512 picks."""

MOST_THREADS = 256
"""Threads of the largest fabric that is served."""

DENSITIES = (0.5, 400.0)
"""Least and most threads per centimetre that are served."""

CHANGES: Mapping[str, type] = {
    "threads": list, "weave": str, "coverage": list, "density": list
}  # fmt: skip
"""What a page may change: see `changed`."""


def changed(fabric: Fabric, said: Mapping[str, Any]) -> Fabric:
    """`fabric` with the changes of a request; what it does not name stays.

    threads : a list of numbers for each thread, as `page.threads` has them
    weave : rows of 0 and 1 from the first pick on, with `/` between them; "" for the fabric's own
    coverage : of warp and weft, from 0 to 1; -1 for the fabric's own
    density : of warp and weft [1/cm]; -1 for the fabric's own

    Raises FabricError for changes that make no fabric.
    """
    if said.get("threads"):
        lists = said["threads"]
        for k, one in enumerate(lists):
            if not isinstance(one, list):
                raise FabricError(f"threads {k}", "is not a list of numbers")
            for value in one:
                number(f"threads {k}", value, -1e6, 1e6)
        fabric = with_numbers(fabric, lists)
    if text := said.get("weave"):
        fabric = replace(fabric, weave=_woven(fabric, text))
    sets = {which: getattr(fabric, which) for which in ("warp", "weft")}
    for name, low, high, unit in (("coverage", 0.0, 1.0, 1.0), ("density", *DENSITIES, 100.0)):
        asked = said.get(name) or [-1, -1]
        if len(asked) != 2:
            raise FabricError(name, f"has {len(asked)} numbers; it must have 2")
        for which, value in zip(sets, asked, strict=True):
            if value != -1:
                found = number(f"{name} of the {which}", value, low, high) * unit
                sets[which] = replace(sets[which], **{name: found})
    # One at a time they might cover more than the cloth.
    return replace(fabric, **sets)


def _woven(fabric: Fabric, text: str) -> Weave:
    if len(text) > 2 * MOST_CELLS:
        raise FabricError("weave", f"is larger than {MOST_CELLS} cells")
    found = text.split("/")
    if fault := rows.fault(found):
        raise FabricError("weave", fault)
    require_small(len(found) * len(found[0]), "the weave")
    cells = rows.to_cells(found)
    if cells.shape == fabric.weave.cells.shape and (cells == fabric.weave.cells).all():
        return fabric.weave
    return Weave(cells, "drawn")


def require_small(cells: int, where: str) -> None:
    """Raise FabricError for a weave of more than MOST_CELLS cells."""
    if cells > MOST_CELLS:
        raise FabricError(
            where, f"has {cells} cells; it must have at most {MOST_CELLS} to be served"
        )

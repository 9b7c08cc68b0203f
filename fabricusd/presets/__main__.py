"""Write the layers of the derived presets.

python -m fabricusd.presets [--only NAME ...] [--keep-sides] [-o DIR]

The shares of light by side are measured on each cloth's tubes, which takes about ten seconds for
a plain weave. `--keep-sides` takes those of the layers that are there, where only colours, yarn or
words have changed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fabricusd.errors import FabricError, did_you_mean
from fabricusd.geometry.sides import measure_sides
from fabricusd.presets.make import made, woven
from fabricusd.presets.rows import ROWS, Row
from fabricusd.schema import load, save
from fabricusd.schema.source import TRADE
from fabricusd.sides import Sides


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the presets that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", metavar="NAME", help="write these alone")
    parser.add_argument(
        "--keep-sides", action="store_true", help="keep the shares by side that the layers state"
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        type=Path,
        default=TRADE,
        help="folder (default: %(default)s)",
    )
    options = parser.parse_args(arguments)
    rows = {row.name: row for row in ROWS}
    try:
        for name in options.only or rows:
            if name not in rows:
                raise FabricError(
                    "--only", f"is '{name}'{did_you_mean(name, rows)}; see {__name__}"
                )
            sides = _kept(name) if options.keep_sides else measured(rows[name])
            save(made(rows[name], sides), options.output / f"{name}.usda")
            print(name, flush=True)
    except FabricError as error:
        print(f"fabricusd.presets: {error}", file=sys.stderr)
        return 2
    return 0


def measured(row: Row) -> Sides:
    """The shares by side of the cloth of a row, as `fabricusd sides` measures them."""
    return measure_sides(replace(woven(row), model="conserving"))


def _kept(name: str) -> Sides:
    return load(TRADE / f"{name}.usda").sides


if __name__ == "__main__":
    sys.exit(main())

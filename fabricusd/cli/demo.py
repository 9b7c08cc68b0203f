"""`fabricusd demo`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from fabricusd.errors import FabricError

if TYPE_CHECKING:
    from fabricusd.fabric import Fabric

SHOWN = "silk_shot"
"""The preset that the last lines propose to look at."""

EPILOG = """Prints a line for each cloth among the presets, and what to open; single yarns and
backs are written too. With -v, each is described and drawn.

example:
  fabricusd demo -o demo"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where to write."""
    parser.add_argument(
        "-o", "--output", metavar="DIR", default="demo", help="folder (default: demo)"
    )


def run(options: argparse.Namespace) -> int:
    """Write every preset as a layer, check it, read it back, and write its draft as WIF."""
    from fabricusd.schema import check, load, preset_names, save
    from fabricusd.schema.describe import in_words
    from fabricusd.weaves import draw, from_fabric, write_wif

    folder = Path(options.output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FabricError(str(folder), f"cannot be made: {error.strerror}") from error
    findings = 0
    for name in preset_names():
        fabric = load(name)
        layer = folder / f"{name}.usda"
        save(fabric, layer)
        write_wif(from_fabric(fabric), folder / f"{name}.wif")
        found = check(str(layer))
        findings += len(found)
        for finding in found:
            print(f"{finding.severity}: {finding}")
        if load(layer) != fabric:
            print(f"{layer} reads back as a different fabric")
            findings += 1
        if options.verbose:
            print(f"{in_words(fabric)}\n\n{draw(fabric, width=72, height=24, color=False)}\n")
        elif not options.quiet and not name.startswith("thread_") and not name.endswith("_back"):
            print(_line(fabric))
    if not options.quiet:
        print()
        print(f"Look at one:  fabricusd cat {folder / SHOWN}.usda")
        print(f"Change it:    open {folder / SHOWN}.usda in an editor or in usdview")
        print("Put it on:    fabricusd help dress")
    print(
        f"fabricusd: {len(preset_names())} presets in {folder}, each as .usda and .wif, "
        f"{findings} findings",
        file=sys.stderr,
    )
    return 1 if findings else 0


def _line(fabric: Fabric) -> str:
    """Name, weave and densities of a fabric."""
    weave = f"{fabric.weave.name or 'unnamed weave'}"
    densities = f"{fabric.warp.density / 100:.3g} x {fabric.weft.density / 100:.3g} threads/cm"
    return f"{fabric.name:30} {weave:22} {densities}"

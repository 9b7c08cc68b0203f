"""`fabricusd demo`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from fabricusd.errors import FabricError

EPILOG = """example:
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
        if not options.quiet:
            print(in_words(fabric))
            print()
            print(draw(fabric, width=72, height=24, color=False))
            print()
    print(
        f"fabricusd: {len(preset_names())} presets in {folder}, {findings} findings",
        file=sys.stderr,
    )
    return 1 if findings else 0

"""`fabricusd cat`."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
from collections.abc import Sequence

from fabricusd.cli.arguments.picture import add_picture, leave_picture, require_picture_name
from fabricusd.cli.terminal.stdout import can_show, write_utf8
from fabricusd.errors import FabricError

EPILOG = """FILE is a USD file, FILE:/PRIM, a WIF draft, an image of a weave, or a preset.

example:
  fabricusd cat silk_crepe_de_chine
  fabricusd cat tartan.usda:/Cloth/Tartan --json
  fabricusd cat damask.usda --wif > damask.wif"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """A fabric, and the form in which to print it."""
    parser.add_argument("file", metavar="FILE", help="USD file, FILE:/PRIM, draft or preset")
    parser.add_argument("prim", metavar="PRIM", nargs="?", help="path of the WovenFabric prim")
    form = parser.add_mutually_exclusive_group()
    form.add_argument(
        "--json", action="store_true", help="print everything as JSON, in SI units and degrees"
    )
    form.add_argument("--flatten", action="store_true", help="print the composed stage as USD text")
    form.add_argument("--wif", action="store_true", help="print the draft as a WIF file")
    add_picture(parser)
    parser.add_argument("--no-draft", action="store_true", help="do not draw the draft")
    parser.add_argument(
        "--color",
        choices=("auto", "always", "never"),
        default="auto",
        help="draw the draft in colour (default: auto, on a terminal)",
    )


def run(options: argparse.Namespace) -> int:
    """Print one fabric."""
    from fabricusd.schema.anysource import load_any

    source = f"{options.file}:/{options.prim.lstrip('/')}" if options.prim else options.file
    require_picture_name(options)
    if options.flatten:
        if options.picture:
            raise FabricError("--picture", "is of one fabric; give it without --flatten")
        from fabricusd.schema.source import flattened

        write_utf8(flattened(source))
        return 0
    fabric, notes = load_any(source)
    _tell(source, notes, options)
    leave_picture(fabric, options)
    if options.wif:
        from fabricusd.weaves import from_fabric, wif_text

        draft = from_fabric(fabric)
        write_utf8(wif_text(draft))
        _tell(source, draft.warnings, options)
        return 0
    from fabricusd.schema.describe import as_dict, in_words

    if options.json:
        print(json.dumps(as_dict(fabric), indent=2))
        return 0
    size = shutil.get_terminal_size((80, 24))
    color = options.color == "always" or (
        options.color == "auto" and sys.stdout.isatty() and "NO_COLOR" not in os.environ
    )
    print(in_words(fabric, width=size.columns))
    if not options.no_draft:
        from fabricusd.weaves import draw

        plain = not can_show("▀▄█…")
        lines = max(size.lines, 48)
        print()
        print(draw(fabric, width=size.columns, height=lines, color=color, ascii_only=plain))
    return 0


def _tell(source: str, notes: Sequence[str], options: argparse.Namespace) -> None:
    for note in notes:
        if not options.quiet:
            print(f"fabricusd: {source}: {note}", file=sys.stderr)

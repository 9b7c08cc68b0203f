"""`fabricusd set`."""

from __future__ import annotations

import argparse
import sys

from fabricusd.cli.arguments.picture import add_picture, leave_picture, require_picture_name

EPILOG = """NAME is an attribute of the schema, whole or its last word (thread:ior, ior), in the
unit of the schema, or a word of the trade:

  color, colour        of cloth of the thread, as in 'new': #rrggbb, navy, "lab(40, 10, -30)" (D65);
                       the albedo is solved for it (a preset's keeps its ratio to the colour)
  roughness            0 to 1, of both lobes: 0.25 a bright filament, 0.55 spun linen
  yarn                 yarn count, 20 tex or "Ne 30/2"; the thickness follows by Peirce
  weight               14oz or 470gsm: scales the yarn counts, densities stay
  ends-per-cm, picks-per-cm, ends-per-inch, picks-per-inch
  grain, scale         of a binding: degrees; millimetres per UV unit

warp.NAME, weft.NAME and THREAD.NAME set it on those threads alone. The file's own layer is changed;
undo is left to version control. Threads keep their colour when the weave, a density or the
scattering changes: their albedo is solved again, and a line says so.

example:
  fabricusd set denim.usda weight=14oz warp.colour="#1f2a4d" roughness=0.6
  fabricusd set denim.usda warp.colour="#5a1f2d" --variant claret
  fabricusd set shot.usda:/World/Shirt grain=45"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to change, and where."""
    parser.add_argument(
        "file", metavar="FILE[:/PRIM]", help="USD file, and a fabric, thread or garment in it"
    )
    parser.add_argument("changes", metavar="NAME=VALUE", nargs="+", help="what to set")
    parser.add_argument(
        "--variant",
        metavar="V",
        default="",
        help="set it in this variant of the fabric, V or SET=V, and select that (default: set it "
        "over all variants; SET: fabricVariant)",
    )
    add_picture(parser)
    parser.add_argument("-n", "--dry-run", action="store_true", help="check, but write nothing")


def run(options: argparse.Namespace) -> int:
    """Set the values, and say on how many prims."""
    from fabricusd.schema.edit import parse_change, set_values
    from fabricusd.schema.read import load

    require_picture_name(options)
    if options.picture:
        # Of what cannot be shown, such as a thread, nothing is set either.
        load(options.file)
    changes = [parse_change(text) for text in options.changes]
    told = set_values(options.file, changes, variant=options.variant, write=not options.dry_run)
    if options.picture and not options.dry_run:
        leave_picture(load(options.file), options)
    if not options.quiet:
        for line in told:
            print(f"fabricusd: {options.file}: {line}", file=sys.stderr)
    return 0

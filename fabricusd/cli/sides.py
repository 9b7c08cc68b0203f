"""`fabricusd sides`."""

from __future__ import annotations

import argparse
import sys

from fabricusd.cli.arguments.number import number
from fabricusd.cli.terminal.stdout import write_utf8

EPILOG = """The repeat is traced as tubes. The result is a layer that overrides the attributes
fabric:sides:* of the fabric: sublayer it, or copy the lines into the fabric. Measure again after a
change of the weave, the densities, the coverage or the curves; colours and lobes matter little.

example:
  fabricusd sides denim.usda
  fabricusd sides tartan.usda:/Cloth/Tartan -o tartan_sides.usda"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """A fabric, how long to trace it, and where to write."""
    parser.add_argument("file", metavar="FILE", help="USD file, FILE:/PRIM or preset")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help=".usda, .usdc or .usd file (default: print USD text)",
    )
    parser.add_argument(
        "--paths",
        type=number("paths"),
        metavar="N",
        help="paths traced for each of 90 directions (default: 32768, for errors of .003)",
    )
    parser.add_argument("--no-clobber", action="store_true", help="never replace a file")


def run(options: argparse.Namespace) -> int:
    """Measure one fabric and write what was measured."""
    from fabricusd.schema.read import load_placed
    from fabricusd.schema.write import export, require_layer_name, sides_layer, sides_text

    output = None if options.output == "-" else options.output
    if output is not None:
        require_layer_name(output)
    path, fabric = load_placed(options.file)
    from fabricusd.geometry.sides import COUNT, measure_sides

    sides = measure_sides(fabric, count=options.paths or COUNT)
    if output is None:
        write_utf8(sides_text(path, sides))
        return 0
    export(sides_layer(path, sides), output, clobber=not options.no_clobber)
    if options.verbose:
        print(f"fabricusd: wrote {output}", file=sys.stderr)
    return 0

"""`fabricusd samples`."""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path

EPILOG = """Prints the files, and what to do with each.

example:
  fabricusd samples
  fabricusd dress fabricusd-samples/skirt.obj --units cm --fabric denim -o skirt.usda
  fabricusd render skirt.usda skirt.png --quick"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where to write."""
    parser.add_argument(
        "output",
        nargs="?",
        default="fabricusd-samples",
        metavar="DIR",
        help="folder (default: fabricusd-samples)",
    )
    parser.add_argument("--no-clobber", action="store_true", help="never replace a file")


def run(options: argparse.Namespace) -> int:
    """Write the files."""
    from fabricusd.samples.write import SAMPLES, write_samples

    paths = write_samples(Path(options.output).expanduser(), clobber=not options.no_clobber)
    for path in paths:
        print(path)
        if not options.quiet:
            _, what, command = SAMPLES[path.name]
            print(f"  {what}: {command.format(shlex.quote(str(path)))}", file=sys.stderr)
    return 0

"""`fabricusd blender-addon`."""

from __future__ import annotations

import argparse
from pathlib import Path

EPILOG = """In Blender: Edit > Preferences > Add-ons > Install from Disk, then File > Import >
fabricusd look. It needs no other part of fabricusd.

example:
  fabricusd blender-addon
  fabricusd blender-addon ~/.config/blender/4.5/extensions/user_default/fabricusd_looks"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where to write the add-on."""
    parser.add_argument(
        "output", nargs="?", default="fabricusd_looks.zip", metavar="ZIP_OR_FOLDER",
        help="file or folder to write (default: fabricusd_looks.zip)",
    )  # fmt: skip
    parser.add_argument("--no-clobber", action="store_true", help="never replace a file")
    parser.add_argument(
        "-n", "--dry-run", action="store_true", help="check the arguments, but write nothing"
    )


def run(options: argparse.Namespace) -> int:
    """Write the add-on, and print its path."""
    from fabricusd.materials.targets.blender.pack import check_target, write_addon

    path, clobber = Path(options.output).expanduser(), not options.no_clobber
    if options.dry_run:
        check_target(path, clobber=clobber)
    else:
        print(write_addon(path, clobber=clobber))
    return 0

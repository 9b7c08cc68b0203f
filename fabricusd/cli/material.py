"""`fabricusd material`."""

from __future__ import annotations

import argparse
import os
import sys

from fabricusd.errors import FabricError
from fabricusd.files import require_writable

EPILOG = """example:
  fabricusd material baked
  fabricusd material baked --scene coat.usda -o coat_look.usda --surface openpbr gltf_pbr
  fabricusd material baked --usdz coat.usdz --osl"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which bake, over what, as which surfaces."""
    parser.add_argument("bake", metavar="DIR", help="folder that 'fabricusd bake' made")
    parser.add_argument(
        "--scene", metavar="SCENE", help="put the look over this USD scene, which was baked"
    )
    parser.add_argument("-o", "--output", metavar="LOOK", help="layer (default: DIR/look.usda)")
    parser.add_argument(
        "--surface",
        nargs="+",
        default=["openpbr"],
        metavar="NAME",
        help="openpbr, standard_surface, gltf_pbr, hair; USD takes the first",
    )
    parser.add_argument("--usdz", metavar="FILE", help="also package the look in one file")
    parser.add_argument(
        "--osl", action="store_true", help="also each fabric's threads as an OSL shader"
    )
    parser.add_argument(
        "--u3m", metavar="FOLDER", help="also a U3M swatch of each fabric, for garment CAD"
    )
    parser.add_argument("--no-fit", action="store_true", help="leave the textures as they are")
    parser.add_argument("-n", "--dry-run", action="store_true", help="check, but write nothing")
    parser.add_argument("--no-clobber", action="store_true", help="never overwrite a look")


def _require_targets(options: argparse.Namespace) -> None:
    """Refuse before the fits what could not be written after them."""
    if options.usdz is not None:
        if not options.usdz.endswith(".usdz"):
            raise FabricError(f"--usdz '{options.usdz}'", "has another suffix; it must be .usdz")
        require_writable(options.usdz, clobber=not options.no_clobber)
    if options.u3m is not None and not os.path.isdir(options.u3m):
        raise FabricError(f"--u3m '{options.u3m}'", "is no directory; make it first")


def run(options: argparse.Namespace) -> int:
    """Write the look; print the names of the files."""
    from pathlib import Path

    _require_targets(options)
    from fabricusd.materials.materials import write_materials
    from fabricusd.materials.recipes import Settings

    def say(line: str) -> None:
        print(f"fabricusd: {line}", file=sys.stderr)

    made = write_materials(
        options.bake, options.output,
        Settings(
            surfaces=tuple(options.surface), fitted=not options.no_fit, osl=options.osl,
            usdz=Path(options.usdz) if options.usdz else None,
            u3m=Path(options.u3m) if options.u3m else None,
        ),
        scene=options.scene, clobber=not options.no_clobber, dry_run=options.dry_run,
        progress=say if options.verbose else None,
    )  # fmt: skip
    for path in made.files:
        print(path)
    if not options.quiet:
        for note in made.notes:
            say(note)
    return 1 if made.notes else 0

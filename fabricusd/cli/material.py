"""`fabricusd material`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from fabricusd.cli.arguments.number import number
from fabricusd.cli.arguments.scheduler import add_scheduler
from fabricusd.materials.near import AUTO, NEAR
from fabricusd.materials.targets import TARGETS

EPILOG = """example:
  fabricusd material baked
  fabricusd material baked --scene coat.usda -o coat_look.usda --surface openpbr gltf_pbr
  fabricusd material baked --surface openpbr lobes --lobes 6
  fabricusd material baked --usdz coat.usdz --osl
  fabricusd material baked --scene coat.usda -o coat_look.usda --glb coat.glb --swatch tiles
  fabricusd material baked_red --asset assets/coat --colorway red
  fabricusd material wardrobe --surface openpbr lobes --scheduler tcp://10.0.0.1:8786"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which bake, over which scene, as which surfaces and targets."""
    parser.add_argument("bake", metavar="DIR", help="folder that 'fabricusd bake' made")
    parser.add_argument(
        "--scene",
        metavar="SCENE",
        help="the USD scene that was baked; the look is a layer over it "
        "(default: the look stands alone)",
    )
    parser.add_argument(
        "-o", "--output", metavar="LOOK", help="layer to write (default: DIR/look.usda)"
    )
    parser.add_argument(
        "--surface",
        nargs="+",
        default=["openpbr"],
        metavar="NAME",
        help="openpbr, standard_surface, gltf_pbr, hair, lobes; USD gets the first "
        "(default: openpbr)",
    )
    parser.add_argument(
        "--lobes",
        type=number("lobes"),
        default=4,
        metavar="N",
        help="number of lobes of the surface 'lobes', 1 to 6 (default: 4)",
    )
    parser.add_argument(
        "--max-error",
        type=number("max_error"),
        metavar="E",
        help="fewer lobes where their mean delta E 2000 is at most E (default: N lobes)",
    )
    parser.add_argument(
        "--near", choices=NEAR, default=AUTO,
        help="threads that the surface 'lobes' shows near by in Blender: those of the bake's "
        "'texels', one 'repeat' of even threads, or 'off'; 'auto' takes the texels where 4 of them "
        "show a thread, and else the repeat (default: auto)",
    )  # fmt: skip
    for target in TARGETS:
        given: dict[str, Any] = {"metavar": target.metavar}
        given = given if target.metavar else {"action": "store_true"}
        parser.add_argument(f"--{target.name}", help=target.help, **given)
    parser.add_argument(
        "--colorway", default="", metavar="NAME",
        help="variant of --asset that the bake becomes (default: its fabrics' names)",
    )  # fmt: skip
    add_scheduler(parser)
    parser.add_argument("--no-fit", action="store_true", help="leave the textures as they are")
    parser.add_argument("-n", "--dry-run", action="store_true", help="check, but write nothing")
    parser.add_argument("--no-clobber", action="store_true", help="never replace a file")


def _targets(options: argparse.Namespace) -> dict[str, Path | None]:
    """The requested targets and their files; refused before the work if they cannot be written."""
    wanted: dict[str, Path | None] = {}
    for target in TARGETS:
        given = getattr(options, target.name.replace("-", "_"))
        if given is not None and given is not False:
            wanted[target.name] = Path(given) if target.metavar else None
            target.functions.check(wanted[target.name], not options.no_clobber)
    return wanted


def run(options: argparse.Namespace) -> int:
    """Write the look, and print the names of the files."""
    targets = _targets(options)
    from fabricusd.materials.materials import write_materials
    from fabricusd.materials.recipes import Settings

    def say(line: str) -> None:
        print(f"fabricusd: {line}", file=sys.stderr)

    made = write_materials(
        options.bake, options.output,
        Settings(
            surfaces=tuple(options.surface), fitted=not options.no_fit, targets=targets,
            colorway=options.colorway, lobes=options.lobes, max_error=options.max_error,
            near=options.near,
        ),
        scene=options.scene, clobber=not options.no_clobber, dry_run=options.dry_run,
        progress=None if options.quiet else say, scheduler=options.scheduler,
    )  # fmt: skip
    for path in made.files:
        print(path)
    if not options.quiet:
        for line in (*made.notes, *made.remarks):
            say(line)
    return 1 if made.notes else 0

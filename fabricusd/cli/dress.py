"""`fabricusd dress`."""

from __future__ import annotations

import argparse
import math
import sys

from fabricusd.cli.arguments.number import number
from fabricusd.cli.arguments.units import add_units

EPILOG = """MESH is an .obj, .glb, .gltf or .ply file, or a USD file, which is referenced. The scene
holds the garments, the fabric, a material that carries it, a backdrop, lights and a camera.

example:
  fabricusd dress shirt.obj --units cm --fabric linen_plain -o shirt.usda
  fabricusd dress front.obj back.obj --units mm --fabric denim.usda --grain 90 -o jeans.usda
  fabricusd render shirt.usda -o shirt.exr"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which garments, in which fabric, and where to write."""
    parser.add_argument("meshes", metavar="MESH", nargs="+", help="mesh or USD file of a garment")
    parser.add_argument(
        "--fabric", metavar="FILE[:/PRIM]", required=True, help="fabric file, draft or preset"
    )
    add_units(parser)
    parser.add_argument(
        "--grain",
        type=number("grain"),
        default=0.0,
        metavar="DEGREES",
        help="angle from the meshes' u axis to the weft, counter-clockwise; 45 is cut on the bias "
        "(default: 0, the warp along v)",
    )
    parser.add_argument(
        "--scale",
        type=number("scale"),
        default=0.0,
        metavar="MM",
        help="length of one UV unit on the cloth, in mm (default: 0, measured on each mesh)",
    )
    parser.add_argument(
        "-o", "--output", metavar="SCENE", required=True, help=".usda, .usdc or .usd file"
    )
    parser.add_argument("-n", "--dry-run", action="store_true", help="check, but write nothing")
    parser.add_argument("--no-clobber", action="store_true", help="never replace a file")


def run(options: argparse.Namespace) -> int:
    """Write the scene, and say what wears the fabric."""
    from fabricusd.materials.dressing import dress

    made = dress(
        options.meshes,
        options.output,
        fabric=options.fabric,
        units=options.units,
        grain=math.radians(options.grain),
        scale=options.scale * 1e-3,
        clobber=not options.no_clobber,
        write=not options.dry_run,
    )
    if options.quiet:
        return 0
    for line in (*made.notes, *made.meshes):
        print(f"fabricusd: {line}", file=sys.stderr)
    if options.dry_run:
        print(f"fabricusd: would write {', '.join(map(str, made.files))}", file=sys.stderr)
    else:
        picture = made.files[0].with_suffix(".exr")
        print(
            f"fabricusd: to see it: fabricusd render {made.files[0]} -o {picture}", file=sys.stderr
        )
    return 0

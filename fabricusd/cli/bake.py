"""`fabricusd bake`."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from typing import Any

from fabricusd.cli.arguments.number import number
from fabricusd.cli.arguments.scheduler import add_scheduler
from fabricusd.cli.arguments.units import add_units
from fabricusd.errors import FabricError

EPILOG = """example:
  fabricusd bake towel.obj --fabric linen_plain --resolution 4096 -o baked
  fabricusd bake coat.usda --mesh /Coat/Front --texels-per-thread 4 --udim -o baked
  fabricusd bake towel.obj --fabric velvet --maps base_color normal opacity -o baked"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to bake, at which resolution, into which maps."""
    parser.add_argument("scene", metavar="SCENE", nargs="?", help="USD, OBJ, glTF or PLY file")
    parser.add_argument(
        "--fabric",
        metavar="FILE[:/PRIM]",
        help="fabric for meshes that are bound to none (default: leave them out)",
    )
    add_units(parser)
    parser.add_argument(
        "--mesh", metavar="PATH", help="prim path of the only mesh to bake (default: every mesh)"
    )
    parser.add_argument(
        "-o", "--output", metavar="DIR", help="folder for the textures (no default)"
    )
    finely = parser.add_mutually_exclusive_group()
    finely.add_argument(
        "--resolution", type=int, metavar="N", help="texels per side (default: 1024)"
    )
    finely.add_argument(
        "--texels-per-thread",
        type=float,
        metavar="X",
        help="choose the resolution that gives a thread this many texels (default: by "
        "--resolution)",
    )
    parser.add_argument("--maps", nargs="+", metavar="MAP", help="maps to bake (default: all)")
    parser.add_argument("--list-maps", action="store_true", help="list the maps and exit")
    parser.add_argument(
        "--udim", action="store_true", help="bake one texture per UDIM tile, 1001 to 1109"
    )
    _add_layout(parser)
    parser.add_argument(
        "--max-error",
        type=float,
        metavar="DE",
        help="increase the resolution until the mean delta E 2000 is at most this; --resolution "
        "is then the upper limit (default: 4096)",
    )
    parser.add_argument(
        "--btf",
        nargs="+",
        metavar="FORM",
        help="also write a BTF of each fabric: ubo, ubo-joint, factored, atlas (default: none)",
    )
    parser.add_argument(
        "--format",
        default="exr",
        choices=("exr", "png", "tiff"),
        help="exr: half floats with mip levels; png, tiff: 16-bit integers (default: exr)",
    )
    parser.add_argument("--resume", action="store_true", help="continue a bake that was stopped")
    parser.add_argument(
        "--workers", type=number("workers"), metavar="N", help="CPU threads (default: all)"
    )
    add_scheduler(parser)
    parser.add_argument("-n", "--dry-run", action="store_true",
        help="check, but write nothing; without -o, the folder is not checked",
    )  # fmt: skip
    parser.add_argument(
        "--no-clobber", action="store_true", help="refuse a folder that holds a bake already"
    )


def _add_layout(parser: argparse.ArgumentParser) -> None:
    """How the fabric lies on the texture, and how it is lit and seen."""
    layout = parser.add_mutually_exclusive_group()
    layout.add_argument("--fit", action="store_true", help="scale the UVs into the unit square")
    layout.add_argument(
        "--unwrap",
        choices=("x", "y", "z"),
        help="make new UVs, with the warp along this world axis (default: the UVs of the mesh)",
    )
    parser.add_argument(
        "--light",
        metavar="X,Y,Z",
        help="direction to the light of the map 'shadow', in the surface's frame (default: no "
        "such map)",
    )
    parser.add_argument(
        "--shadow",
        default="peak",
        choices=("peak", "horizon", "traced"),
        help="shadowing method of the map 'shadow' (default: peak)",
    )
    parser.add_argument(
        "--level",
        default="weave",
        choices=("weave", "thread"),
        help="weave: flat threads, thread: round threads (default: weave)",
    )


def run(options: argparse.Namespace) -> int:
    """Bake, and print the names of the files."""
    from pathlib import Path

    from fabricusd.bake.bake import bake, plan
    from fabricusd.bake.job import Settings
    from fabricusd.bake.ranges import positive
    from fabricusd.bake.texels.maps import REGISTRY

    if options.list_maps:
        for one in REGISTRY.values():
            print(f"{one.name:18} {one.meaning}")
        return 0
    if not options.scene or not (options.output or options.dry_run):
        raise FabricError("bake", "needs a SCENE and -o DIR; see 'fabricusd bake --help'")
    out = Path(options.output) if options.output else None
    if options.no_clobber and out is not None and (out / "manifest.json").exists():
        raise FabricError(str(out), "holds a bake; it must be a new folder with --no-clobber")
    # In Settings, 0 means that nothing was asked for; on the command line it is out of range.
    per_thread, max_error = options.texels_per_thread, options.max_error
    if per_thread is not None:
        positive("--texels-per-thread", per_thread)
    if max_error is not None:
        positive("--max-error", max_error)
    resolution = options.resolution
    if resolution is None:
        resolution = 1024 if max_error is None else 4096
    settings = Settings(
        resolution=resolution,
        texels_per_thread=per_thread or 0.0,
        maps=tuple(options.maps) if options.maps else None,
        light=_light(options.light),
        shadow=options.shadow,
        level=options.level,
        udim=options.udim,
        fit=options.fit,
        unwrap=options.unwrap or "",
        max_error=max_error or 0.0,
        btf=tuple(options.btf or ()),
        file_format=options.format,
    )
    if options.dry_run:
        planned = plan(
            options.scene, settings, out=out, fabric=options.fabric, mesh=options.mesh,
            units=options.units, workers=options.workers,
        )  # fmt: skip
        for line in planned.lines:
            print(line)
        for note in () if options.quiet else planned.notes:
            print(f"fabricusd: {note}", file=sys.stderr)
        return 0
    assert out is not None
    result = bake(
        options.scene, out, settings, fabric=options.fabric, mesh=options.mesh,
        units=options.units, resume=options.resume, workers=options.workers,
        scheduler=options.scheduler, progress=_progress(options),
        portrait=partial(_portrait, options),
    )  # fmt: skip
    if not options.quiet:
        for note in result.notes:
            print(f"fabricusd: {note}", file=sys.stderr)
    if not result.finished:
        print("fabricusd: stopped; continue with --resume", file=sys.stderr)
        return 130
    for maps in result.files.values():
        for files in maps.values():
            for name in files.values():
                print(out / name)
    print(out / "manifest.json")
    print(out / "report.html")
    if options.verbose:
        print(f"fabricusd: baked in {result.seconds:.1f} s", file=sys.stderr)
    if settings.max_error and not result.reached(settings.max_error):
        worst = max(e.point for e in result.errors.values())
        print(
            f"fabricusd: the error at {result.resolution} texels is delta E {worst:.3g}; "
            f"--max-error asks for {settings.max_error:g}",
            file=sys.stderr,
        )
        return 1
    return 0


def _portrait(options: argparse.Namespace) -> Any:
    """The garment as `preview` draws it, for the report."""
    from fabricusd.preview.portrait import portrait

    return portrait(options.scene, fabric=options.fabric, units=options.units)


def _light(text: str | None) -> tuple[float, float, float] | None:
    if text is None:
        return None
    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError:
        raise FabricError(
            f"--light '{text}'", "is not a direction; write three numbers: X,Y,Z"
        ) from None
    return x, y, z


def _progress(options: argparse.Namespace) -> Any:
    """Show progress in one line, on a terminal only."""
    if options.quiet or not sys.stderr.isatty():
        return None

    def show(noun: str, total: int, done: int) -> None:
        end = "\n" if done == total else ""
        print(f"\r{noun} {done}/{total}", end=end, file=sys.stderr, flush=True)

    return show

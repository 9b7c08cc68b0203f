"""`fabricusd new`."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from fabricusd.cli.arguments.draft import (
    add_color_basis,
    add_colors,
    add_figure,
    add_sources,
    given_draft,
)
from fabricusd.cli.arguments.picture import add_picture, leave_picture, require_picture_name
from fabricusd.cli.arguments.thread import named_thread
from fabricusd.cli.arguments.yarn import add_yarns, settle_densities, spun
from fabricusd.cli.terminal.stdout import write_utf8
from fabricusd.errors import FabricError

if TYPE_CHECKING:
    from fabricusd.fabric import Fabric, Thread
    from fabricusd.weaves.color import RGB

SOURCES = ("preset", "weave", "source", "wif", "image", "figure", "tartan", "stripes")
"""Options of which at least one is needed."""

NOT_OF_PRESETS = (
    "tartan", "stripes", "palette", "thread", "warp_color", "weft_color", "thickness", "invert",
    "yarn", "warp_yarn", "weft_yarn", "albedo", "single_layer", "observer",
)  # fmt: skip
"""Options that a preset, whose threads and weave are what they are, cannot follow."""

EPILOG = """WEAVE is a name (plain, basket 2/2, twill 2/1 S, satin 8 step 3, herringbone 2/2 8,
houndstooth, ...) or an expression in the end i and the pick j (mod(2*i + j, 5) < 4).

A COLOR is that of cloth woven of the thread alone, as a textile laboratory measures it: under CIE
D65, in diffuse light, seen at 8 degrees with the specular part, folded until opaque. Write #rrggbb,
a CSS name, lab(L, a, b), lch(L, C, h) or xyY(x, y, Y) with Y to 100, all under D65 (CSS's lab is
under D50), a reflectance spectrum as a CSV file, or linear r,g,b. A colour that no such cloth has
becomes the nearest.

example:
  fabricusd new --preset velvet -o velvet.usda
  fabricusd new --weave "twill 2/2 Z" --warp-color "#1f2a4d" --weft-color "#e8e0d0" -o denim.usda
  fabricusd new --weave plain --warp-color navy --weft-color "lab(92, 0, 3)" -o chambray.usda
  fabricusd new --weave "twill 2/2" --warp-color "4*#333" "4*#eee" -o houndstooth.usda
  fabricusd new --tartan "B24 W4 B24 R2 K24" --ends-per-cm 22 --picks-per-cm 22 -o tartan.usda
  fabricusd new --figure rose.png --figure-ends 480 --ends-per-cm 60 --picks-per-cm 40 -o rose.usda
  fabricusd new --weave "twill 3/1" --warp-yarn "Ne 7" --weft-yarn "Ne 8" --ends-per-inch 68 \\
      --picks-per-inch 44 --weight 14oz --warp-color "#1f2a4d" --weft-color "#ddd" -o denim14.usda
  fabricusd new --from 8452.wif --thread linen_plain -o draft.usda"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The source of the weave, its threads, and where to write."""
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--preset", metavar="NAME", help="a fabric that comes with fabricusd")
    add_sources(source)
    source.add_argument("--list-presets", action="store_true", help="list the presets and exit")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help=".usda, .usdc, .usd or .wif file (default: print USD text)",
    )
    parser.add_argument("--name", help="name of the prim (default: from the output file)")
    add_colors(parser)
    add_color_basis(parser)
    parser.add_argument(
        "--thread",
        metavar="FABRIC[:THREAD]",
        help="make the threads scatter like those of this fabric file or preset; their size stays, "
        "and their colour where none is given (default: a spun thread of the --fibre)",
    )
    parser.add_argument(
        "--invert", action="store_true", help="in an image, white means warp on top"
    )
    add_yarns(parser)
    add_figure(parser)
    add_picture(parser)
    parser.add_argument("-n", "--dry-run", action="store_true", help="check, but write nothing")
    parser.add_argument("--no-clobber", action="store_true", help="never replace a file")


def run(options: argparse.Namespace) -> int:
    """Make the fabric and write it."""
    if options.list_presets:
        from fabricusd.schema.source import preset_names

        print("\n".join(preset_names()))
        return 0
    if all(getattr(options, source) is None for source in SOURCES):
        raise FabricError(
            "",
            "there is nothing to make a fabric from; give one of --preset, --weave, --from, --wif, "
            "--image, --figure, --tartan, --stripes, or --list-presets",
        )
    if options.output == "-":
        options.output = None
    require_picture_name(options)
    settle_densities(options)
    fabric, notes, wanted = _fabric(options)
    fabric, spinning = spun(_changed(fabric, options), options)
    fabric, dyeing = _dyed(fabric, wanted, options)
    _write(fabric, options)
    if not options.dry_run:
        leave_picture(fabric, options)
    for note in (*notes, *spinning, *dyeing):
        if not options.quiet:
            print(f"fabricusd: {note}", file=sys.stderr)
    return 0


def _fabric(
    options: argparse.Namespace,
) -> tuple[Fabric, tuple[str, ...], tuple[RGB, ...] | None]:
    """(the fabric before it is spun and dyed, notes, the colours to dye it with or None)."""
    if options.preset is not None:
        from fabricusd.schema.read import load
        from fabricusd.schema.source import VARIANTS, preset_hint, preset_names
        from fabricusd.weaves.draft import quoted

        named = VARIANTS.sub("", options.preset)
        if named not in preset_names():
            raise FabricError(
                "",
                f"there is no preset {quoted(named)}{preset_hint(named)}; see "
                "'fabricusd new --list-presets'",
            )
        for option in NOT_OF_PRESETS:
            # Compare by identity, since 0 == False.
            if not any(getattr(options, option) is unset for unset in (None, False)):
                raise FabricError(
                    _flag(option), "cannot be used with --preset; edit the layer that new writes"
                )
        return load(options.preset), (), None
    from dataclasses import replace

    from fabricusd.weaves import losses, to_fabric

    draft = given_draft(options)
    for which, density in (("warp", options.ends_per_cm), ("weft", options.picks_per_cm)):
        if density is not None:
            told = {f"{which}_spacing": 0.01 / density, f"{which}_spacings": ()}
            draft = replace(draft, **told)
    fabric = to_fabric(draft, _base_thread(options))
    as_the_donor = bool(options.thread) and not draft.palette
    for option in ("albedo", "single_layer", "observer"):
        if as_the_donor and getattr(options, option):
            raise FabricError(_flag(option), "needs a colour: give --warp-color or --weft-color")
    wanted = None if as_the_donor else draft.palette
    return fabric, (*draft.warnings, *losses(draft)), wanted


def _dyed(
    fabric: Fabric, wanted: tuple[RGB, ...] | None, options: argparse.Namespace
) -> tuple[Fabric, tuple[str, ...]]:
    """(the fabric in the colours asked for, a line for each that cannot be reached)."""
    if wanted is None:
        return fabric, ()
    from fabricusd.dye.make import made_of_colors
    from fabricusd.fabric import BASES

    done = made_of_colors(
        fabric,
        basis=BASES[2] if options.single_layer else BASES[1],
        observer=int(options.observer or 2),
        palette=wanted,
        raw=options.albedo,
    )
    return done.fabric, done.notes


def _flag(option: str) -> str:
    return f"--{option.replace('_', '-')}"


def _base_thread(options: argparse.Namespace) -> Thread:
    from dataclasses import replace

    if not options.thread:
        from fabricusd.dye.make import thread_of
        from fabricusd.weaves.yarn import DEFAULT_FIBRE, fibre_density

        fibre = options.fibre or DEFAULT_FIBRE
        fibre_density(fibre)
        return thread_of(fibre.lower())
    fabric, name = named_thread(options.thread)
    thread = fabric.threads[name]
    # How it scatters is a matter of the fibre; how thick it is, of this cloth.
    return replace(thread, thickness=0.0, linear_density=0.0)


def _changed(fabric: Fabric, options: argparse.Namespace) -> Fabric:
    from dataclasses import replace
    from pathlib import Path

    changes: dict[str, Any] = {}
    for which, value in (("warp", options.ends_per_cm), ("weft", options.picks_per_cm)):
        if value is not None:
            changes[which] = replace(getattr(fabric, which), density=value * 100)
    name = options.name
    if not name and not options.preset:
        name = Path(
            options.output
            or options.source
            or options.wif
            or options.image
            or options.figure
            or ("tartan" if options.tartan else fabric.name)
        ).stem
    if name:
        from fabricusd.schema.names import prim_name

        changes["name"] = prim_name(name)
    return replace(fabric, **changes)


def _write(fabric: Fabric, options: argparse.Namespace) -> None:
    from fabricusd.schema.write import EXTENSIONS, save, usd_text
    from fabricusd.weaves import from_fabric, wif_text, write_wif

    output = options.output
    wif = output is not None and output.lower().endswith(".wif")
    if output is not None and not wif and not output.lower().endswith(EXTENSIONS):
        raise FabricError(
            f"-o '{output}'", f"must end in one of {', '.join((*EXTENSIONS, '.wif'))}"
        )
    if options.dry_run:
        print(f"fabricusd: would write {fabric.name} to {output or 'stdout'}", file=sys.stderr)
        (wif_text(from_fabric(fabric)) if wif else usd_text(fabric))
    elif output is None:
        write_utf8(usd_text(fabric))
    elif wif:
        write_wif(from_fabric(fabric), output, clobber=not options.no_clobber)
    else:
        save(fabric, output, clobber=not options.no_clobber)
        if options.verbose:
            print(f"fabricusd: wrote {output}", file=sys.stderr)

"""The options of a fit of photographs of flat cloth, and what is done with them."""

from __future__ import annotations

import argparse
import math
import sys
from typing import TYPE_CHECKING

from fabricusd.cli.arguments.number import number
from fabricusd.errors import FabricError, one_line

if TYPE_CHECKING:
    from fabricusd.measure.flat.fit import Flat

ONLY_FLAT = ("weave", "pitch", "light", "back_light", "view_angle", "cloth_width", "card",
             "card_reflectance", "page")  # fmt: skip
"""Options that mean nothing without --flat."""

VIEW_ANGLE = 53.0


def add_flat(parser: argparse.ArgumentParser) -> None:
    """How flat cloth was photographed."""
    flat = parser.add_argument_group(
        "flat cloth, with --flat; lengths are heights of the camera above the cloth, x is right "
        "and y up in the picture, z towards the camera, 0 in the middle of the cloth"
    )
    flat.add_argument(
        "--weave",
        metavar="WEAVE",
        help="the weave, as in 'new'; a twill without S or Z, and a satin without step, leave "
        "these open (default: found out, which takes 6 pixels a thread)",
    )
    flat.add_argument(
        "--pitch",
        metavar="ENDS,PICKS",
        help="pixels from end to end and from pick to pick (default: by the spectrum)",
    )
    flat.add_argument(
        "--light", nargs=3, type=float, metavar=("X", "Y", "Z"),
        help="place of the lamp before the cloth (no default)",
    )  # fmt: skip
    flat.add_argument(
        "--back-light", nargs=3, type=float, metavar=("X", "Y", "Z"),
        help="place of the lamp behind the cloth, of the second photograph (no default)",
    )  # fmt: skip
    flat.add_argument(
        "--view-angle",
        type=number("view_angle"),
        metavar="DEG",
        help=f"field of view across the picture (default: {VIEW_ANGLE:g})",
    )
    flat.add_argument(
        "--cloth-width",
        type=number("cloth_width"),
        metavar="CM",
        help="length of cloth across the picture, for densities (default: 10, and said)",
    )
    flat.add_argument(
        "--card",
        metavar="FILE",
        help="photograph of a white card in the cloth's place, same light and exposure (default: "
        "none; A and the lamp's power are then hardly told apart)",
    )
    flat.add_argument(
        "--card-reflectance",
        type=number("card_reflectance"),
        metavar="R",
        help="reflectance of the card, 0 to 1 (default: 0.9)",
    )
    flat.add_argument(
        "--page",
        metavar="FILE",
        help=".html page with photograph, render and difference (default: none)",
    )
    flat.add_argument(
        "--spp", type=number("spp"), default=32, metavar="N",
        help="samples per pixel of the page's renders (default: 32)",
    )  # fmt: skip


def refuse_flat_options(options: argparse.Namespace) -> None:
    """Raise FabricError for options of --flat without it."""
    for name in ONLY_FLAT:
        if getattr(options, name) is not None:
            raise FabricError(f"--{name.replace('_', '-')}", "can only be used with --flat")


def run_flat(options: argparse.Namespace) -> int:
    """Fit flat cloth, print what is known of it, and write it."""
    from fabricusd.measure.flat.fit import fit_flat
    from fabricusd.measure.flat.photograph import read_photograph, require_same_size
    from fabricusd.measure.flat.setup import Setup

    if len(options.flat) > 2:
        raise FabricError(
            "--flat", f"names {len(options.flat)} photographs; it must name one lit from before, "
            "and at most one lit from behind",
        )  # fmt: skip
    if options.light is None:
        raise FabricError(
            "--light", "is missing; where was the lamp? Give X Y Z in heights of the camera"
        )
    if len(options.flat) == 2 and options.back_light is None:
        raise FabricError("--back-light", "is missing; where was the lamp behind the cloth?")
    setup = Setup(
        light=tuple(options.light),
        back_light=None if options.back_light is None else tuple(options.back_light),
        view_angle=VIEW_ANGLE if options.view_angle is None else options.view_angle,
        width=0.0 if options.cloth_width is None else 0.01 * _positive(options),
    )
    pitch = None if options.pitch is None else _pitch(options.pitch)
    _require_outputs(options)
    photographs = [read_photograph(path) for path in options.flat]
    card = None if options.card is None else read_photograph(options.card)
    for other in (*photographs[1:], *(() if card is None else (card,))):
        require_same_size(photographs[0], other)
    if options.dry_run:
        from fabricusd.measure.flat.weave import find_weave

        lattice, _ = find_weave(photographs[0], options.weave)
        print(f"{lattice.weave.name}, {lattice.pitch[0]:.3g} x {lattice.pitch[1]:.3g} pixels")
        return 0
    flat = fit_flat(
        photographs[0], photographs[1] if len(photographs) > 1 else None, setup,
        weave=options.weave, pitch=pitch, card=card,
        card_reflectance=0.9 if options.card_reflectance is None else options.card_reflectance,
    )  # fmt: skip
    print("\n".join(flat.lines()))
    _write(flat, options)
    return 0


def _write(flat: Flat, options: argparse.Namespace) -> None:
    from pathlib import Path

    from fabricusd.files import write_json
    from fabricusd.measure.estimates_file import save_measured

    if options.output is not None:
        save_measured(
            flat.fabric,
            {v.label: (v.value, v.low, v.high, v.unit, v.source) for v in flat.values},
            options.output,
            photograph=", ".join(options.flat),
            notes=flat.notes,
            clobber=not options.no_clobber,
        )
    if options.report is not None:
        write_json(Path(options.report), flat.as_json())
    if options.page is not None:
        from fabricusd.measure.flat.compare import compare, rendered_through
        from fabricusd.measure.flat.page import page_text, write_page

        made = compare(flat, spp=options.spp)
        through = None if flat.behind is None else rendered_through(flat, spp=options.spp)
        write_page(options.page, page_text(flat, made, through))
        words = ", ".join(f"{name} {value:.3f}" for name, value in made.figures.items())
        print(f"FLIP: {words}; delta E 2000 of the render {made.delta_e:.2f}")
    if options.verbose:
        for path in (options.output, options.report, options.page):
            if path is not None:
                print(f"fabricusd: wrote {path}", file=sys.stderr)


def _require_outputs(options: argparse.Namespace) -> None:
    from fabricusd.files import require_writable
    from fabricusd.schema.write import require_layer_name

    if options.output is not None:
        require_layer_name(options.output)
    if options.page is not None and not options.page.lower().endswith((".html", ".htm")):
        raise FabricError(options.page, "is not a page; its name must end in .html")
    for path in (options.output, options.report, options.page):
        if path is not None:
            require_writable(path, clobber=not options.no_clobber)


def _positive(options: argparse.Namespace) -> float:
    value = float(options.cloth_width)
    if not (math.isfinite(value) and value > 0):
        raise FabricError("--cloth-width", f"is {value:g} cm; it must be above 0")
    return value


def _pitch(text: str) -> tuple[float, float]:
    try:
        ends, picks = (float(part) for part in text.split(","))
    except ValueError:
        ends = picks = 0.0
    if not (math.isfinite(ends) and math.isfinite(picks) and min(ends, picks) > 1):
        raise FabricError(
            "--pitch",
            f"is '{one_line(text, 60)}'; it must be two numbers of pixels above 1, ENDS,PICKS",
        )
    return ends, picks

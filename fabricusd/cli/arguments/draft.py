"""The options that say what is woven, in which colours, and the draft that they ask for."""

from __future__ import annotations

import argparse
import re
from typing import TYPE_CHECKING, Any

from fabricusd.cli.arguments.number import number
from fabricusd.errors import FabricError

if TYPE_CHECKING:
    from fabricusd.weaves import Draft

FIGURE_ONLY = ("figure_weave", "ground_weave", "ground_color", "figure_ends", "figure_picks",
               "longest_float")  # fmt: skip
"""Options that mean nothing without --figure."""


def add_sources(source: Any) -> None:
    """Where the weave comes from; `source` is a group of which one is given."""
    source.add_argument(
        "--weave",
        metavar="WEAVE",
        help="a named weave or an expression (default with --tartan: twill 2/2, with --stripes: "
        "plain)",
    )
    source.add_argument(
        "--from",
        dest="source",
        metavar="FILE",
        help="a WIF draft or a drawdown as an image, told by its suffix",
    )
    source.add_argument("--wif", metavar="FILE", help="a WIF draft, with any suffix")
    source.add_argument(
        "--image",
        metavar="FILE",
        help="a drawdown, one pixel a crossing, black where the warp is on top",
    )
    source.add_argument(
        "--figure",
        metavar="FILE",
        help="artwork, whose regions of colour are woven each in a weave of its own",
    )


def add_colors(parser: argparse.ArgumentParser) -> None:
    """The colours of the threads in their order."""
    order = parser.add_mutually_exclusive_group()
    order.add_argument(
        "--tartan",
        nargs="+",
        metavar="SETT",
        help='threadcount of warp and weft, or of each: "B24 W4 B24 R2 K24" turns at its first and '
        'last stripe, "...B24 W4 R2..." repeats (default: colours by --warp-color)',
    )
    order.add_argument(
        "--stripes",
        metavar="SETT",
        help="threadcount of the warp; the weft has --weft-color, or the first stripe's colour "
        "(default: colours by --warp-color)",
    )
    parser.add_argument(
        "--palette",
        nargs="+",
        metavar="CODE=COLOR",
        help="colours of the codes in a threadcount: B=#1f2a4d (default: shades of the Scottish "
        "Register's codes)",
    )
    for which, noun in (("warp", "ends"), ("weft", "picks")):
        parser.add_argument(
            f"--{which}-color",
            nargs="+",
            metavar="COLOR",
            help=f"colours of the {noun} in order: a COLOR as below, or COUNT*COLOR "
            "(default: the draft's, or a light grey)",
        )


def add_color_basis(parser: argparse.ArgumentParser) -> None:
    """What the colours are the colours of."""
    basis = parser.add_mutually_exclusive_group()
    basis.add_argument(
        "--single-layer",
        action="store_true",
        help="colours are those of one layer of cloth over black (default: folded until opaque)",
    )
    basis.add_argument(
        "--albedo",
        action="store_true",
        help="colours are the raw albedo of the threads, from 0 to 1, and nothing is solved",
    )
    parser.add_argument(
        "--observer",
        choices=("2", "10"),
        help="CIE standard observer of lab(), lch(), xyY() and spectra, in degrees (default: 2)",
    )


def add_figure(parser: argparse.ArgumentParser) -> None:
    """How artwork is woven."""
    figure = parser.add_argument_group("figured weaves, with --figure")
    figure.add_argument(
        "--figure-weave",
        nargs="+",
        metavar="WEAVE",
        help="weave of the figure (default: satin 8); for several regions, #rrggbb=WEAVE each",
    )
    figure.add_argument(
        "--ground-weave", metavar="WEAVE", help="weave of the ground (default: satin 8 weft)"
    )
    figure.add_argument(
        "--ground-color",
        metavar="COLOR",
        help="colour of the ground in the artwork (default: the commonest along its border)",
    )
    for noun in ("ends", "picks"):
        figure.add_argument(
            f"--figure-{noun}",
            type=number(f"figure_{noun}"),
            metavar="N",
            help=f"{noun} of the figure's repeat (default: one a pixel, or in proportion)",
        )
    figure.add_argument(
        "--longest-float",
        type=number("longest_float"),
        metavar="N",
        help="tie floats longer than this many threads (default: the longest of the weaves)",
    )


def given_draft(options: argparse.Namespace) -> Draft:
    """The draft that the options ask for; FabricError for options that do not go together."""
    from fabricusd.weaves import parse_weave, with_colors
    from fabricusd.weaves.readers import DraftOptions, read_draft, reader_name, suffixes

    for option in FIGURE_ONLY:
        if options.figure is None and getattr(options, option) is not None:
            raise FabricError(f"--{option.replace('_', '-')}", "can only be used with --figure")
    warp, weft = _colors(options)
    weave = options.weave
    if options.tartan or options.stripes:
        threadcount = "--tartan" if options.tartan else "--stripes"
        if options.source or options.wif or options.image or options.figure:
            raise FabricError(threadcount, "has colours for a --weave; it cannot colour a file's")
        weave = weave or ("twill 2/2" if options.tartan else "plain")
    if options.invert and (weave or options.figure):
        raise FabricError("--invert", "can only be used with an image")
    if weave is not None:
        draft = parse_weave(weave)
        return with_colors(draft, warp, weft) if warp or weft else draft
    if options.figure is not None:
        return with_colors(_figure(options), warp, weft)
    told = DraftOptions(warp=list(warp), weft=list(weft), invert=options.invert)
    if options.source is None:
        reader = "wif" if options.wif is not None else "image"
        return read_draft(getattr(options, reader), told, reader)
    if not reader_name(options.source):
        raise FabricError(
            f"--from '{options.source}'",
            f"is not a draft; its name must end in {', '.join(suffixes())}",
        )
    return read_draft(options.source, told)


def _colors(options: argparse.Namespace) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """The linear colours of ends and picks, in order; () where none are given."""
    from fabricusd.weaves.color import color_order
    from fabricusd.weaves.tartan import parse_codes, parse_threadcount

    observer = int(options.observer or 2)
    warp = color_order(options.warp_color or (), "--warp-color", observer)
    weft = color_order(options.weft_color or (), "--weft-color", observer)
    codes = parse_codes(options.palette or ())
    if options.palette and not (options.tartan or options.stripes):
        raise FabricError("--palette", "can only be used with --tartan or --stripes")
    if options.tartan:
        if warp or weft:
            option = "--warp-color" if warp else "--weft-color"
            raise FabricError(option, "cannot be used with --tartan, which has colours")
        if len(options.tartan) > 2:
            raise FabricError(
                "--tartan",
                f"has {len(options.tartan)} threadcounts; it must have one, or one for the warp "
                "and one for the weft, each in quotes",
            )
        setts = [parse_threadcount(text, codes, "--tartan") for text in options.tartan]
        return setts[0], setts[-1]
    if options.stripes:
        if warp:
            raise FabricError("--warp-color", "cannot be used with --stripes, which has colours")
        stripes = parse_threadcount(options.stripes, codes, "--stripes")
        return stripes, weft or stripes[:1]
    return warp, weft


def _figure(options: argparse.Namespace) -> Draft:
    from fabricusd.weaves import parse_color
    from fabricusd.weaves.figure import Figure, read_figure

    weaves = []
    for item in options.figure_weave or ["satin 8"]:
        color = re.match(r"(#[0-9a-fA-F]*)\s*=\s*(?!=)", item)
        weaves.append(
            (parse_color(color[1], "--figure-weave"), item[color.end() :])
            if color
            else (None, item)
        )
    ground = options.ground_color
    ends_per_cm, picks_per_cm = options.ends_per_cm or 20.0, options.picks_per_cm or 20.0
    return read_figure(
        options.figure,
        Figure(
            weaves=weaves,
            ground_weave=options.ground_weave or "satin 8 weft",
            ground_color=None if ground is None else parse_color(ground, "--ground-color"),
            ends=options.figure_ends,
            picks=options.figure_picks,
            pitch_ratio=picks_per_cm / ends_per_cm,
            longest=options.longest_float,
        ),
    )

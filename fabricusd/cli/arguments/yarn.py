"""The options that say how heavy, how thick and how close the threads are."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from fabricusd.cli.arguments.number import number
from fabricusd.errors import FabricError

if TYPE_CHECKING:
    from fabricusd.fabric import Fabric

CENTIMETRES_PER_INCH = 2.54


def add_yarns(parser: argparse.ArgumentParser) -> None:
    """Densities, yarn counts, thickness and weight."""
    yarn = parser.add_argument_group("densities, yarns and weight")
    for which, noun in (("warp", "ends"), ("weft", "picks")):
        density = yarn.add_mutually_exclusive_group()
        for unit in ("cm", "inch"):
            density.add_argument(
                f"--{noun}-per-{unit}",
                type=number(f"{noun}_per_{unit}"),
                metavar="N",
                help=f"density of the {which}, per {unit} of cloth"
                f" (default: the draft's, or {'20' if unit == 'cm' else '50.8'})",
            )
    yarn.add_argument(
        "--yarn",
        metavar="COUNT",
        help="yarn count of warp and weft: 20 tex, 330 dtex, 150 den, Ne 30/2, Nm 2/60; it gives "
        "the thickness by Peirce (default: threads fill their pitch)",
    )
    for which in ("warp", "weft"):
        yarn.add_argument(
            f"--{which}-yarn", metavar="COUNT", help=f"yarn count of the {which} (default: --yarn)"
        )
    yarn.add_argument(
        "--fibre",
        "--fiber",
        metavar="NAME",
        help="fibre of the yarns, for how they scatter and for the density in Peirce's diameter: "
        "cotton, linen, wool, silk, viscose, polyester, nylon, acrylic, acetate (default: cotton)",
    )
    yarn.add_argument(
        "--packing",
        type=number("packing"),
        metavar="SHARE",
        help="share of a yarn that its fibres fill, above 0, at most 1 (default: 0.6)",
    )
    yarn.add_argument(
        "--thickness",
        type=number("thickness"),
        metavar="MM",
        help="visible width of the threads, in mm; precedes that of a yarn count "
        "(default: the count's, the draft's, or the pitch)",
    )
    yarn.add_argument(
        "--weight",
        metavar="W",
        help="weight of the cloth, 14oz (per square yard) or 470gsm: scales the yarn counts, and "
        "keeps the densities (default: what it comes to)",
    )
    yarn.add_argument(
        "--open",
        action="store_true",
        help="the gap between the threads is meant: write it as coverage, without a warning",
    )


def settle_densities(options: argparse.Namespace) -> None:
    """Turn densities per inch into densities per cm."""
    for noun in ("ends", "picks"):
        inch = getattr(options, f"{noun}_per_inch")
        if inch is not None:
            setattr(options, f"{noun}_per_cm", inch / CENTIMETRES_PER_INCH)


def spun(fabric: Fabric, options: argparse.Namespace) -> tuple[Fabric, list[str]]:
    """(`fabric` of the yarns and the weight asked for, what was changed and what is open)."""
    from fabricusd.schema.rules.closed import opened, unasked_gap
    from fabricusd.weaves.cloth import parse_weight, weight, with_weight, with_yarns
    from fabricusd.weaves.yarn import PACKING, fibre_density, parse_count

    counts = {}
    for which in ("warp", "weft"):
        option = f"--{which}-yarn" if getattr(options, f"{which}_yarn") else "--yarn"
        text = getattr(options, f"{which}_yarn") or options.yarn
        counts[which] = None if text is None else parse_count(text, option)
    known = any(count is not None for count in counts.values())
    for option in ("fibre", "packing"):
        # Without a count, a fibre still says how a thread scatters that no one else describes.
        scatters = option == "fibre" and not (options.preset or options.thread)
        if getattr(options, option) is not None and not known and not scatters:
            raise FabricError(f"--{option}", "needs a yarn count: give --yarn too, as in Ne 30")
    notes = []
    thickness = None if options.thickness is None else options.thickness * 1e-3
    fibre = fibre_density(options.fibre or "cotton")
    packing = PACKING if options.packing is None else options.packing
    if known or thickness is not None:
        fabric = with_yarns(fabric, **counts, fibre=fibre, packing=packing, thickness=thickness)
    if known and thickness is None:
        thick = ", ".join(
            f"{thread.thickness * 1e3:.3g} mm"
            for thread in dict.fromkeys(
                fabric.thread_list[side.sequence[0]] for side in (fabric.warp, fabric.weft)
            )
        )
        notes.append(
            f"The yarns are {thick} thick by Peirce, of {options.fibre or 'cotton'}, "
            f"{fibre / 1000:.3g} g/cm3, at a packing of {packing:g}."
        )
    if options.weight is not None:
        wanted = parse_weight(options.weight)
        before = weight(fabric)
        fabric = with_weight(fabric, wanted, keep_thickness=thickness is not None)
        assert before is not None
        notes.append(
            f"The yarn counts are {wanted / before.total:.3g} times what they were "
            f"({before}), and the densities are kept, for a cloth of {weight(fabric)}."
        )
    if options.open:
        return opened(fabric), notes
    gap = unasked_gap(fabric)
    if gap:
        notes.append(
            f"The cloth {gap}; give more ends and picks, a thicker yarn, or --open if it is meant."
        )
    return fabric, notes

"""A card of 24 ColorChecker colours and a ladder of greys on cotton: asked for against measured.

    python bench/colour/bench_card.py [--weave plain "twill 2/2" "satin 8"] [--traced N] [-o DIR]

Each colour is given to a cloth as `fabricusd new` does, and measured as it is defined, by two
routes that share nothing with the solver: a quadrature of the law that is rendered, added up over
layers; and, for every N-th colour with --traced, a stack of layers in a uniform sky by the path
tracer.
Exits with 1 if a colour within reach is off by more than 1 delta E 2000.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from pathlib import Path

import numpy as np
from measure import shares, stacked, traced

from fabricusd.dye.difference import code, colour_science, difference
from fabricusd.dye.make import made_of_colors, thread_of
from fabricusd.images.files import write_png
from fabricusd.srgb import srgb_encode
from fabricusd.weaves import parse_weave, to_fabric, with_colors

WEAVES = ("plain", "twill 2/2", "satin 8")
GREYS = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
ALLOWED = 1.0


def card():
    """Name -> linear Rec. 709: the ColorChecker under D65, and greys by reflectance."""
    colour = colour_science()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        checker = colour.CCS_COLOURCHECKERS["ColorChecker24 - After November 2014"]
        space = colour.RGB_COLOURSPACES["ITU-R BT.709"]
        found = {
            name: np.asarray(
                colour.XYZ_to_RGB(
                    colour.chromatic_adaptation(
                        colour.xyY_to_XYZ(xyy),
                        colour.xy_to_XYZ(checker.illuminant),
                        colour.xy_to_XYZ(space.whitepoint),
                    ),
                    space,
                )
            )
            for name, xyy in checker.data.items()
        }
    return {**found, **{f"grey {r:g}": np.full(3, r) for r in GREYS}}


def cloth(weave: str, color):
    """(fabric of cotton in the colour, notes)."""
    inside = tuple(float(max(c, 0)) for c in color)
    draft = with_colors(parse_weave(weave), [inside], [inside])
    done = made_of_colors(to_fabric(draft, thread_of("cotton")), palette=[tuple(color)])
    return done.fabric, done.notes


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--weave", nargs="+", default=list(WEAVES))
    parser.add_argument("--traced", type=int, default=0, metavar="N")
    parser.add_argument("-o", "--output", default="")
    options = parser.parse_args()
    rows, bad = [], 0
    for weave in options.weave:
        for k, (name, color) in enumerate(card().items()):
            fabric, notes = cloth(weave, color)
            found = stacked(shares(fabric))
            off = float(difference(found, color))
            row = {
                "weave": weave, "name": name, "asked": code(color), "measured": code(found),
                "dE": off, "reachable": not notes, "colours": [list(color), list(found)],
            }  # fmt: skip
            text = f"{weave:10} {name:16} {code(color)} {code(found)}  dE {off:5.2f}"
            if options.traced and k % options.traced == 0:
                seen, error, left = traced(fabric)
                row["traced"], row["traced_dE"] = code(seen), float(difference(seen, color))
                row["against"] = float(difference(seen, found))
                row["remainder"] = left
                text += (
                    f"  traced {code(seen)} dE {row['traced_dE']:5.2f} (from the quadrature "
                    f"{row['against']:.2f}, noise {error:.1e}, remainder {left:.1e})"
                )
            bad += not notes and off > ALLOWED
            print(text + ("" if not notes else f"   {notes[0]}"), flush=True)
            rows.append(row)
    within = [row["dE"] for row in rows if row["reachable"]]
    print(
        f"{len(within)} of {len(rows)} within reach: delta E 2000 at most {max(within):.3f}, mean "
        f"{np.mean(within):.3f}"
    )
    if options.output:
        folder = Path(options.output)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "card.json").write_text(json.dumps(rows, indent=1))
        patches = np.array([row["colours"] for row in rows]).reshape(len(options.weave), -1, 2, 3)
        image = np.repeat(
            np.repeat(np.concatenate([p.swapaxes(0, 1) for p in patches]), 48, 0), 32, 1
        )
        write_png(folder / "card.png", np.rint(srgb_encode(image) * 255).astype(np.uint8))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())

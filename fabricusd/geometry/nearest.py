"""Which surface law is nearest to a preset's tubes, and the albedos to wear it with.

python -m fabricusd.geometry.nearest [NAME ...] prints both; with --write the presets' layers get
them as the variant `nearest` of their variant set `appearance`, beside `published`. The law is
judged on the pairs that are not held out. The published `A` were tuned under the law `masked`:
under another law they are scaled by one factor, so that the cloth reflects as much of a white sky
at 8 degrees as it did. Where its surface alone reflects more than that, `A` is kept.

Pile keeps `masked`, since its tubes are right to a factor of two only. Satin's back has no tubes,
and wears the law of its front.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import laws, surface
from fabricusd.appearance.published.excess import white_sky
from fabricusd.fabric import PILE_ANGLE, Fabric
from fabricusd.files import whole_file
from fabricusd.geometry.judge import judge
from fabricusd.geometry.tables import table, table_names
from fabricusd.schema import load
from fabricusd.schema.colors import LINEAR
from fabricusd.schema.source import PRESETS

Floats = NDArray[np.float64]

APPEARANCE = "appearance"
NEAREST, PUBLISHED, CONSERVING = "nearest", "published", "conserving"
"""The presets' variant set, and its variants; the last is made by `geometry.conserve`."""

TIE = 0.01
"""Errors that differ by less than this are equal: the earlier law of PREFERRED is taken. `visible`
costs a fifth of the speed of `projected`, and comes after it."""

PREFERRED = ("projected", "visible", "unmasked", "masked")

LIKE = {"polyester_satin_charmeuse_back": "polyester_satin_charmeuse"}
"""Presets without a geometry, and those whose law they wear."""

REC_709 = np.array([0.2126, 0.7152, 0.0722])


def published(name: str) -> Fabric:
    """A preset with its published numbers, under the law that they were tuned with."""
    return load(f"{name}{{{APPEARANCE}={PUBLISHED}}}")


def law_errors(name: str) -> dict[str, float]:
    """Mean absolute error over mean of each law, on the pairs that are not held out."""
    found, fabric = table(name), load(name)
    return {
        law: judge(
            found,
            surface.evaluate(
                replace(fabric, surface_law=law), found.wi, found.wo, shadow="horizon"
            ),
            ~found.held_out,
        ).error
        for law in laws.REGISTRY
    }


def nearest(errors: Mapping[str, float]) -> str:
    """The law with the least error."""
    least = min(errors.values())
    return next(law for law in PREFERRED if errors[law] < least + TIE)


def scaled(fabric: Fabric, factor: float) -> Fabric:
    """`fabric` with `A` of every thread times `factor`."""
    threads = {
        name: replace(t, albedo=(factor * t.albedo[0], factor * t.albedo[1], factor * t.albedo[2]))
        for name, t in fabric.threads.items()
    }
    return replace(fabric, threads=threads)


def refit(fabric: Fabric, law: str) -> float:
    """The factor of `A` with which `fabric` under `law` is as bright as it is under `masked`."""
    asked = _luminance(replace(fabric, surface_law="masked"))
    worn = replace(fabric, surface_law=law)
    black, whole = _luminance(scaled(worn, 0.0)), _luminance(worn)
    return max(0.0, (asked - black) / (whole - black))


def _luminance(fabric: Fabric) -> float:
    """Luminance at 8 degrees under a white sky, the mean over four azimuths."""
    sky, weight = white_sky()
    total = 0.0
    for turn in (0.0, 45.0, 90.0, 135.0):
        a, polar = math.radians(turn), math.radians(8.0)
        wo = np.array(
            [math.sin(polar) * math.cos(a), math.sin(polar) * math.sin(a), math.cos(polar)]
        )
        value = surface.evaluate(fabric, sky, wo, shadow="horizon")
        total += float(weight @ value @ REC_709) / 4.0
    return total


def worn(name: str, errors: Mapping[str, float]) -> tuple[str, float]:
    """The law that a preset is to wear, and the factor on its published `A`.

    errors : of `law_errors`
    """
    fabric = published(name)
    if any(t.curve.steepest > PILE_ANGLE for t in fabric.thread_list):
        return "masked", 1.0
    law = nearest(errors)
    factor = refit(fabric, law)
    return law, factor if factor > 0 else 1.0


def write_variant(name: str, variant: str, fabric: Fabric) -> None:
    """Make model, law and albedos of `fabric` a variant of a preset's layer.

    The layer is changed as text: USD would drop its comments.
    """
    path = PRESETS / f"{name}.usda"
    text = path.read_text("utf-8")
    old = re.search(rf'^ {{8}}"{variant}" {{\n.*?^ {{8}}}}\n', text, re.MULTILINE | re.DOTALL)
    at = text.rindex("    }\n}") if old is None else old.start()
    end = at if old is None else old.end()
    with whole_file(path) as temporary:
        made = text[:at] + _variant_text(name, variant, fabric) + text[end:]
        temporary.write_text(made, "utf-8")


def _variant_text(name: str, variant: str, fabric: Fabric) -> str:
    lines = [
        f'"{variant}" {{',
        f'    uniform token fabric:model = "{fabric.model}"',
        f'    uniform token fabric:surfaceLaw = "{fabric.surface_law}"',
    ]
    for thread, numbers in fabric.threads.items():
        triple = ", ".join(f"{a:.4g}" for a in numbers.albedo)
        lines += [
            "",
            f'    over "{thread}"',
            "    {",
            f"        uniform color3d thread:albedo = ({triple}) (",
            f'            colorSpace = "{LINEAR}"',
            "        )",
            "    }",
        ]
    for back in (b for b, front in LIKE.items() if front == name):
        lines += [
            "",
            f'    over "{back}" (',
            "        variants = {",
            f'            string {APPEARANCE} = "{variant}"',
            "        }",
            "    )",
            "    {",
            "    }",
        ]
    lines.append("}")
    return "".join(f"        {line}\n" if line else "\n" for line in lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print each preset's law, errors and factor, and write them where asked to."""
    parser = argparse.ArgumentParser(
        prog="python -m fabricusd.geometry.nearest", description=__doc__
    )
    parser.add_argument("names", nargs="*", metavar="NAME", default=sorted({*table_names(), *LIKE}))
    parser.add_argument("--write", action="store_true", help="change the presets' layers")
    options = parser.parse_args(arguments)
    for name in options.names:
        errors = law_errors(LIKE.get(name, name))
        law, factor = worn(name, errors)
        told = ", ".join(f"{k} {v:.3f}" for k, v in errors.items())
        print(f"{name}: {law} ({told}), A times {factor:.3f}", flush=True)
        if options.write:
            fabric = replace(scaled(published(name), factor), surface_law=law)
            write_variant(name, NEAREST, fabric)
    return 0


if __name__ == "__main__":
    sys.exit(main())

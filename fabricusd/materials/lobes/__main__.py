"""Print how near mixtures of lobes are to the presets, and remake the table of their fits.

python -m fabricusd.materials.lobes [NAME ...] [--lobes K ...] [--law LAW ...]
    [--write [--form FORM ...]]

A preset is fitted under the law that it wears, and under each `--law`. Under another law its
published albedos are scaled, so that it is as bright as it was under `masked`. The table in the
package is used for what it holds; `--write` fits all again, and replaces the rows of the presets
and laws that it is given. Of several fits, the one is kept whose delta E over the pairs and whose
mean delta E under the skies have the least sum. `--form materialx` fits that form alone again, from
the form of Cycles.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace

from fabricusd.fabric import SURFACE_LAWS, Fabric
from fabricusd.geometry.nearest import published, scaled
from fabricusd.geometry.nearest import refit as albedo_factor
from fabricusd.materials.lobes import known
from fabricusd.materials.lobes.fit import COUNTS, fits, refit
from fabricusd.materials.lobes.judge import Judge, Judged
from fabricusd.materials.lobes.mixture import CYCLES, FORMS, Mixture
from fabricusd.materials.lobes.parameters import at_bounds
from fabricusd.schema import load

PUBLISHED = (
    "linen_plain", "silk_crepe_de_chine", "polyester_satin_charmeuse",
    "polyester_satin_charmeuse_back", "silk_shot", "velvet", "wool_flannel", "rayon_shantung",
)  # fmt: skip


BRIGHTER = 0.01
"""Excess in the worst view up to which a mixture counts as no brighter than the cloth."""


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m fabricusd.materials.lobes")
    parser.add_argument("names", nargs="*", metavar="NAME", help="presets (default: the published)")
    parser.add_argument("--lobes", type=int, nargs="+", default=[4, 6], choices=COUNTS)
    parser.add_argument("--law", nargs="+", default=[], choices=SURFACE_LAWS[:-1])
    parser.add_argument("--write", action="store_true", help="fit again, and write the table")
    parser.add_argument(
        "--form", nargs="+", default=list(FORMS), choices=FORMS,
        help="forms that --write fits again",
    )  # fmt: skip
    parser.add_argument("--bounds", action="store_true", help="name parameters at their bounds")
    return parser.parse_args()


def _worn(name: str, laws: list[str]) -> Iterator[Fabric]:
    """A preset under its own law and under each of `laws`."""
    fabric, other = load(name), published(name)
    yield fabric
    for law in laws:
        if law != fabric.surface_law:
            yield scaled(replace(other, surface_law=law), albedo_factor(other, law))


def _mixtures(
    name: str, fabric: Fabric, counts: list[int], judge: Judge, again: Sequence[str]
) -> Iterator[Mixture]:
    """The mixtures in every form.

    again : forms to fit, from the usual starts and from what the table holds under that name; the
        one that is not brighter than the cloth is kept, and of two the nearer
    """
    for count in counts:
        if CYCLES in again:
            begun: Sequence[Mixture] = fits(fabric, count)
        else:
            begun = [known.mixture_of(fabric, count, CYCLES)]
        first = begun[0]
        for form in FORMS:
            if form not in again:
                yield first if form == CYCLES else known.mixture_of(fabric, count, form)
                continue
            tried = [first]
            if form != CYCLES:
                tried = [refit(fabric, *(known.in_form(one, form) for one in begun))]
            before = known.held(name, fabric, count, form)
            tried += [*before, *(refit(fabric, one) for one in before)]
            yield min(tried, key=lambda one: _rank(judge(one)))


def _rank(judged: Judged) -> tuple[bool, float]:
    skies = list(judged.sky_delta_e.values())
    return judged.excess > BRIGHTER, judged.delta_e + sum(skies) / len(skies)


def _line(name: str, law: str, mixture: Mixture, judged: Judged) -> str:
    skies = " | ".join(
        f"{judged.sky_delta_e[k]:.1f}, {100 * judged.sky_radiance[k]:+.1f} %"
        for k in judged.sky_delta_e
    )
    form = "Cycles" if mixture.form == CYCLES else "MaterialX"
    return (
        f"| {name} | {law} | {mixture.count} | {form} | {judged.delta_e:.2f} | "
        f"{judged.delta_e_95:.1f} | {skies} | {100 * judged.excess:+.1f} % |"
    )


def main() -> int:
    """Print the table, row by row."""
    given = _arguments()
    rows, again = [], given.form if given.write else ()
    print("| preset | law | lobes | form | mean | 95 % | overcast | window | clear | excess |")
    print("|---|---|---|---|---|---|---|---|---|---|", flush=True)
    for name in given.names or PUBLISHED:
        for fabric in _worn(name, given.law):
            judge, held = Judge(fabric), []
            for one in _mixtures(name, fabric, given.lobes, judge, again):
                held.append(one)
                print(_line(name, fabric.surface_law, one, judge(one)), flush=True)
                for told in at_bounds(one) if given.bounds else ():
                    print(f"    {told}")
            rows.append(known.row_of(name, fabric, held))
            if given.write:
                known.add_rows(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""What level `far` gains if a view takes no light from places that neighbours hide from it.

    python bench/model/hidden_from_view.py [--presets NAME ...]

Each node of a law is weighed by the share of its places that the viewer sees, which is the mean of
`g` for light from there, in the sum and in its divisor:

    sum a weight v(wo) f_s cos(theta_i) g / sum a weight v(wo),   v(wo) = mean of g(x, wo)

Against the tubes of docs/geometry.md, with and without: error on held-out pairs (mean absolute
difference over the mean), delta E, error under grazing light, and reflected of a white sky over
that of the tubes at 60, 75 and 80 degrees, brightest channel, mean over azimuths; no view of the
cloth is brighter than white. A star is the law that the preset wears.
`correlated` has places that are lit and seen together, min(g(wi), g(wo)), where the azimuths of
light and view are less than some 25 degrees apart. The law `visible` is `seen` with the means of a
set as a polynomial, and with the gap(w) that the fabric states; its own row is the last.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance import laws
from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.law import surface_law
from fabricusd.appearance.laws.excess import no_excess
from fabricusd.appearance.published.blocks import node_range
from fabricusd.appearance.published.columns import NODE_COS, NODE_SIN, NODE_WEIGHT
from fabricusd.appearance.published.far import node_terms
from fabricusd.appearance.published.segment import along_set
from fabricusd.appearance.scattering.columns import ALBEDO_R
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.geometry.judge import judge
from fabricusd.geometry.tables import AZIMUTHS, POLAR, table, views
from fabricusd.kernels.real import KERNEL
from fabricusd.materials.fit.judge import hemisphere
from fabricusd.schema import load

Floats = NDArray[np.float64]

LIT, SEEN, CORRELATED = FORMS = ("as it is", "seen", "correlated")
WIDTH = math.radians(23.0)
"""Standard deviation of the azimuths at which places are lit and seen together."""
PRESETS = (
    "linen_plain", "silk_crepe_de_chine", "silk_shot", "polyester_satin_charmeuse", "wool_flannel",
)  # fmt: skip
SKY = 1152


@njit(**{**KERNEL, "cache": False}, parallel=True)
def _values(R, tables, seen_too, together, wi, wo, out):  # type: ignore[no-untyped-def]
    """Level `far` of n pairs wi, wo (n, 3), into out (n, 3); together : (n,) share of places that
    are lit and seen together."""
    for k in prange(len(wi)):
        ix, iy, iz = wi[k]
        ox, oy, oz = wo[k]
        whole = R(0)
        for thread_set in (WEFT, WARP):
            first, last = node_range(tables, thread_set)
            pair = along_set(R, tables, thread_set, ix, iy, iz, ox, oy, oz)
            for node in range(first, last):
                c, s = tables.nodes[node, NODE_COS], tables.nodes[node, NODE_SIN]
                p = laws.weight(R, tables, c, s, pair) * tables.nodes[node, NODE_WEIGHT]
                lit = min(max(laws.lit_alone(R, tables, node, ix, iy, iz), R(0)), R(1))
                seen = R(1)
                if seen_too:
                    seen = min(max(laws.lit_alone(R, tables, node, ox, oy, oz), R(0)), R(1))
                whole += p * seen
                both = lit * seen + together[k] * (min(lit, seen) - lit * seen)
                surface, volume = node_terms(R, tables, node, pair)
                row = tables.threads[tables.node_thread[node]]
                for channel in range(3):
                    out[k, channel] += p * both * (surface + volume * row[ALBEDO_R + channel])
        total = laws.total(R, tables, whole, ox, oy, oz)
        for channel in range(3):
            out[k, channel] /= total


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presets", nargs="+", default=PRESETS, metavar="NAME")
    names = parser.parse_args().presets
    print("| preset | law | view | held out | delta E | grazing | 60° | 75° | 80° |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in names:
        if load(name).surface_law == "unmasked":
            _rows(name, "unmasked", FORMS[:1])
        _rows(name, "projected", FORMS)
        _rows(name, "visible", FORMS[:1])


def _rows(name: str, law: str, forms: tuple[str, ...]) -> None:
    real: Any = np.float64
    found, worn = table(name), load(name)
    fabric = replace(worn, surface_law=law)
    shadow = compile_shadow(fabric, precision=real)
    tables: Any = surface_law(fabric, precision=real, shadow=shadow).published
    # The bound of white is applied below: it depends on the form. The divisor of `visible` holds
    # gap(w) as well, and that law has one form.
    if fabric.surface_law != "visible":
        tables = tables._replace(**no_excess(real))
    truth = _by_view(found.sky)
    bright = truth.mean(axis=(0, 1)).argmax()
    sky = hemisphere(SKY)
    for form in forms:
        value = _far(tables, form, found.wi, found.wo)
        held = judge(found, value)
        grazing = judge(found, value, np.arange(len(value)) % 3 == 2)
        white = [_far(tables, form, sky, np.tile(w, (SKY, 1))) for w in views()]
        mine = _by_view(np.array([one.mean(axis=0) * 2.0 * np.pi for one in white]))
        most = np.maximum(mine.max(axis=2, keepdims=True), 1.0)
        ratio = (mine / most).mean(axis=1)[:, bright] / truth.mean(axis=1)[:, bright]
        shown = " | ".join(f"{ratio[POLAR.index(a)]:.2f}" for a in (60.0, 75.0, 80.0))
        star = "*" if law == worn.surface_law else ""
        print(
            f"| {name} | {law}{star} | {form} | {held.error:.3f} | {held.delta_e:.1f} | "
            f"{grazing.error:.2f} | {shown} |",
            flush=True,
        )


def _far(tables: Any, form: str, wi: Floats, wo: Floats) -> Floats:
    apart = np.arctan2(wi[:, 1], wi[:, 0]) - np.arctan2(wo[:, 1], wo[:, 0])
    apart = np.abs((apart + np.pi) % (2.0 * np.pi) - np.pi)
    together = np.exp(-0.5 * (apart / WIDTH) ** 2) * (form == CORRELATED)
    out = np.zeros_like(wi)
    wi, wo = np.ascontiguousarray(wi), np.ascontiguousarray(wo)
    _values(np.float64, tables, form != LIT, together, wi, wo, out)
    return out


def _by_view(values: Floats) -> Floats:
    """(polar, azimuths, 3) of the views of a table."""
    return values.reshape(len(POLAR), len(AZIMUTHS), 3)


if __name__ == "__main__":
    main()

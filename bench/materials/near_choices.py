"""What the choices of the fit near by are worth: delta E 2000 at points of threads.

    python bench/materials/near_choices.py [PRESET ...]

Points of level `weave` with its mean shadow, over the pairs that the fit sees. Each row is a fit
with one choice changed: the weight of the mean over all points (`fit.MEAN`), and that of the likely
factors (`fit.RIDGE`). The last column is how far the mean over the points is from the far mixture.
"""

from __future__ import annotations

import sys

import numpy as np

from fabricusd.materials.lobes.fit import COUNT
from fabricusd.materials.lobes.known import mixture_of
from fabricusd.materials.lobes.mixture import CYCLES
from fabricusd.materials.lobes.mixture import evaluate as evaluate_far
from fabricusd.materials.near import fit
from fabricusd.materials.near.mixture import evaluate
from fabricusd.quality.colors import delta_e_2000
from fabricusd.schema import load

PRESETS = ("linen_plain", "silk_shot", "polyester_satin_charmeuse")

CHOICES = {
    "decided": {},
    "without the mean": {"MEAN": 0.0},
    "four times the mean": {"MEAN": 4.0},
    "a tenth of the ridge": {"RIDGE": 0.1 * fit.RIDGE},
}


def at_points(near, points, wi, wo):
    """(points, n, 3) radiance of the mixture near by, times pi."""
    found = []
    for k in range(len(points.part)):
        one = slice(k, k + 1)
        texel = near.parts.at(points.thread_set[one], points.angle[one], points.part[one])
        found.append(np.pi * evaluate(near, texel, wi, wo))
    return np.array(found)


def main() -> None:
    print("| preset | choice | points | mean |")
    print("|---|---|---|---|")
    decided = {name: getattr(fit, name) for name in ("MEAN", "RIDGE")}
    for preset in sys.argv[1:] or PRESETS:
        fabric = load(preset)
        far = mixture_of(fabric, COUNT, CYCLES)
        problem = fit.Problem(fabric, far)
        points, wi, wo = problem.points, problem.wi, problem.wo
        share = points.weight / points.weight.sum()
        true, whole = np.pi * problem.true, np.pi * evaluate_far(far, wi, wo)

        def row(words, values, preset=preset, points=points, share=share, true=true, whole=whole):
            off = share @ delta_e_2000(values, true).mean(axis=1)
            mean = np.einsum("p,pnc->nc", points.weight, values)
            apart = delta_e_2000(mean, whole).mean()
            print(f"| {preset} | {words} | {off:.1f} | {apart:.1f} |", flush=True)

        for words, changed in CHOICES.items():
            for name, value in {**decided, **changed}.items():
                setattr(fit, name, value)
            row(words, at_points(fit.fit_near(fabric, far), points, wi, wo))
        row("far mixture", np.repeat(whole[None], len(share), axis=0) / points.weight.sum())


if __name__ == "__main__":
    main()

"""What the choices of the fit near by are worth: delta E 2000 at points of threads.

    python bench/materials/near_choices.py [PRESET ...] [--choices NAME ...]

Points of level `weave` with its mean shadow, over the pairs that the fit sees. Each row is a fit
with one choice changed: the weight of the mean over all points (`fit.MEAN`), that of the likely
factors (`fit.RIDGE`), the difference of a lobe's tilt from the mean of its threads, which stays as
it is from afar, and the width of a lobe, whose square is less by twice the variance that the texel
lacks. The last two columns are how far the mean over the points is from the far mixture, and the
mean over texels as wide as a thread, of one repeat. The constant of a lobe is the one between
variance and the square of its width, by the fit.
"""

from __future__ import annotations

import argparse

import numpy as np

from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.materials.lobes.fit import COUNT
from fabricusd.materials.lobes.known import mixture_of
from fabricusd.materials.lobes.mixture import CYCLES
from fabricusd.materials.lobes.mixture import evaluate as evaluate_far
from fabricusd.materials.near import fit, mixture
from fabricusd.materials.near.keep import moved_to
from fabricusd.materials.near.maps import halved, texels_of
from fabricusd.materials.near.parts import Texels
from fabricusd.materials.near.repeat import repeat_layers
from fabricusd.quality.colors import delta_e_2000
from fabricusd.schema import load

PRESETS = ("linen_plain", "silk_shot", "polyester_satin_charmeuse")


def own_angle(near, number, texels):
    known = mixture.constants(near, number)
    return known, mixture._own_angle(near.parts, known.own, known.membership, texels)


def tilt_kept(near, number, texels):
    """`mixture.placed`, where the difference of the tilt does not shrink."""
    (_, far), (known, (share, mean, _)) = near.lobes[number], own_angle(near, number, texels)
    tilt = far + share * (mean - known.mean)
    return PLACED(near, number, texels)._replace(tilt=np.clip(tilt, -1.5, 1.5))


def constant_2(near, number, texels):
    """`mixture.placed`, where alpha^2 is less by twice the variance that the texel lacks."""
    (lobe, _), (known, (share, _, variance)) = near.lobes[number], own_angle(near, number, texels)
    wide, narrow = lobe.alpha_along**2, near.own[number] ** 2
    here = np.maximum(wide - 2.0 * (known.variance - variance), min(narrow, wide))
    alpha = np.sqrt(np.clip(wide + share * (here - wide), min(narrow, wide), 1.0))
    return PLACED(near, number, texels)._replace(alpha=alpha)


PLACED = mixture.placed
NAMES = ("share", "lean", "spread", "tint")
CHOICES = {
    "decided": {},
    "difference of the tilt kept": {"placed": tilt_kept},
    "constant 2": {"placed": constant_2},
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
        found.append(np.pi * mixture.evaluate(near, texel, wi, wo))
    return np.array(found)


def constants_of(near):
    """The least and the largest constant of a lobe, in words: 2 by the variance of slopes alone."""
    found = []
    for number, (lobe, _) in enumerate(near.lobes):
        known = mixture.constants(near, number)
        if known.own.any() and known.variance > mixture.EPSILON:
            found.append((lobe.alpha_along**2 - near.own[number] ** 2) / known.variance)
    return f"constants of lobes: {min(found):.1f} to {max(found):.1f}"


def of_texels(near, fabric, wi, wo):
    """(n, 3) mean over texels as wide as a thread, or nearly, times pi."""
    pixels, parts = repeat_layers(fabric)
    while len(next(iter(pixels.values()))) > 1.2 * max(true_repeat(fabric)):
        pixels = {name: halved(one) for name, one in pixels.items()}
    texels, moved = texels_of(pixels), moved_to(near, parts)
    fields = (texels.share, texels.lean, texels.spread, texels.tint)
    found = [
        mixture.evaluate(moved, Texels(**dict(zip(NAMES, one, strict=True))), wi, wo)
        for one in zip(*(field[:, None] for field in fields), strict=True)
    ]
    return np.pi * np.mean(found, axis=0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("presets", nargs="*", default=PRESETS)
    parser.add_argument("--choices", nargs="+", choices=CHOICES, default=list(CHOICES))
    options = parser.parse_args()
    decided = {name: getattr(fit, name) for name in ("MEAN", "RIDGE", "placed")}
    print("| preset | choice | points | mean of points | of texels |")
    print("|---|---|---|---|---|")
    for preset in options.presets:
        fabric = load(preset)
        far = mixture_of(fabric, COUNT, CYCLES)
        problem = fit.Problem(fabric, far)
        points, wi, wo = problem.points, problem.wi, problem.wo
        share = points.weight / points.weight.sum()
        true, whole = np.pi * problem.true, np.pi * evaluate_far(far, wi, wo)
        for words in options.choices:
            for name, value in {**decided, **CHOICES[words]}.items():
                setattr(fit, name, value)
            mixture.placed = fit.placed
            near = fit.fit_near(fabric, far)
            if words == "decided":
                print(f"| {preset} | {constants_of(near)} | | | |", flush=True)
            values = at_points(near, points, wi, wo)
            means = (
                np.einsum("p,pnc->nc", points.weight, values), of_texels(near, fabric, wi, wo)
            )  # fmt: skip
            off = share @ delta_e_2000(values, true).mean(axis=1)
            apart = " | ".join(f"{delta_e_2000(one, whole).mean():.1f}" for one in means)
            print(f"| {preset} | {words} | {off:.1f} | {apart} |", flush=True)
        alone = share @ delta_e_2000(whole[None] / points.weight.sum(), true).mean(axis=1)
        print(f"| {preset} | far mixture | {alone:.1f} | | |", flush=True)


if __name__ == "__main__":
    main()

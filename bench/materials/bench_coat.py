"""Fit OpenPBR with a tilted coat: what a second lobe would gain where tools read OpenPBR alone.

    python bench/materials/bench_coat.py [PRESET ...]

The coat is `geometry_coat_normal` turned along the weft or along the warp, over the base's own
reflection, whose normal stays or turns the other way; fuzz is on top. The coat is better than
OpenPBR's: it neither roughens nor darkens what is below, and the index of the base stays. The
script prints delta E 2000 over the pairs of `fabricusd.materials.fit` and the score, without and
with the coat, and where the coat ends up.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from fabricusd.chart.panels.materials import baked_texels
from fabricusd.materials.fit import models
from fabricusd.materials.fit.fit import fit
from fabricusd.materials.fit.forward import frames_of, surface_of
from fabricusd.materials.fit.judge import Judge, direction_pairs
from fabricusd.materials.fit.target import target_of
from fabricusd.schema import load

PRESETS = ("linen_plain", "silk_crepe_de_chine", "polyester_satin_charmeuse", "silk_shot")
START = 0.45
"""Tilt at which a coat starts, to either side [rad]."""

ROUNDS, STEPS, PULL = 3, 8, 0.02

# Base colour, index, both widths, tint, fuzz weight and roughness, fuzz colour; coat weight, index,
# widths along and across, tilt; tilt of the base.
LOW = np.array(
    [0.0] * 3 + [1, 0.02, 0.02] + [0] * 3 + [0, 0.05] + [0] * 3 + [0, 1, 0.02, 0.02, -1.3, -0.7]
)
HIGH = np.array([1.0] * 3 + [20, 1, 1] + [1] * 3 + [1, 1] + [1] * 3 + [1, 6, 1, 1, 1.3, 0.7])


def turned(axis, psi, w):
    """Directions in a frame whose normal leans by psi along the weft (0) or the warp (1)."""
    a, up = np.eye(3)[axis], np.eye(3)[2]
    z, x = np.sin(psi) * a + np.cos(psi) * up, np.cos(psi) * a - np.sin(psi) * up
    return w @ np.stack((x, np.cross(z, x), z)).T


def surface(x):
    one = np.ones((1, 1))
    return models.Surface(
        base=x[None, None, :3], ior=x[3] * one, alpha_rough=x[4] * one, alpha_smooth=x[5] * one,
        tint=x[None, None, 6:9], fuzz_weight=x[9] * one, fuzz_roughness=x[10] * one,
        fuzz_color=x[None, None, 11:14],
    )  # fmt: skip


def coat(x, axis, wi, wo):
    """Reflection of the coat, and the share of light that reaches the base."""
    i, o = (turned(axis, x[18], w) for w in (wi, wo))
    plain = np.array([0.0] * 3 + [x[15], x[16], x[17]] + [1.0] * 3 + [0, 0.5] + [0] * 3)
    cosines = (np.clip(w[None, :, 2], models.SMALLEST, 1.0) for w in (i, o))
    value, left = models.specular("openpbr", surface(plain), i[None], o[None], *cosines)
    seen = (o[:, 2:] > 0)[None]
    return np.where(seen & (i[:, 2:] > 0), value, 0.0), np.where(seen, left, 1.0)


class Coated:
    """The model on the texels of a bake of whole repeats."""

    def __init__(self, texels, *, leans):
        self.texels, self.leans, self.frames = texels, leans, frames_of(texels)
        self.wi, self.wo = direction_pairs()

    def __call__(self, x, axis):
        psi = x[19] if self.leans else 0.0
        leaning = [turned(axis, psi, w) for w in (self.wi, self.wo)]
        i, o = (np.einsum("kab,nb->kna", self.frames, w) for w in leaning)
        ci, co = (np.clip(w[..., 2], models.SMALLEST, 1.0) for w in (i, o))
        s = surface(x)
        spec, under = models.specular("openpbr", s, i, o, ci, co)
        fuzz, left = models.zeltner(s, i, o, co)
        base = spec + under * s.base * (ci / np.pi)[..., None]
        above = ((i[..., 2] > 0) & (o[..., 2] > 0))[..., None]
        top, passed = coat(x, axis, self.wi, self.wo)
        value = x[14] * top + (1.0 - x[14] * (1.0 - passed)) * np.where(above, base, 0.0)
        value = fuzz + left[..., None] * value
        return np.einsum("k,knc->nc", self.texels.weight * self.texels.opacity, value)[None]


def best(model, judge, first):
    found = None
    for axis in (0, 1):
        for psi in (-START, START):
            end = np.concatenate((first, [0.5, 2.0, 0.5, 0.3, psi, -0.5 * psi]))
            x, less = np.clip(end, LOW + 1e-4, HIGH - 1e-4), 1.0
            for _ in range(ROUNDS):

                def residuals(y, x=x, less=less, axis=axis):
                    off = judge.residuals(model(y, axis), less)
                    return np.concatenate((off, PULL * (y - x) / (HIGH - LOW)))

                x = least_squares(
                    residuals, x, bounds=(LOW, HIGH), x_scale=0.1, max_nfev=STEPS
                ).x  # fmt: skip
                less = judge.evened(model(x, axis))
            values = model(x, axis)
            row = judge.score(values), float(judge.delta_e(values)[0].mean()), axis, x
            found = row if found is None or row[0] < found[0] else found
    return found


def main() -> None:
    print("| preset | | delta E | score | coat along | coat, base [degrees] |")
    print("|---|---|---|---|---|---|")
    for preset in sys.argv[1:] or PRESETS:
        fabric = load(preset)
        with tempfile.TemporaryDirectory() as name:
            texels = baked_texels(fabric, Path(name), 6400.0)
        target = target_of(fabric, texels)
        judge, plain = Judge(target.values, target.weight), fit("openpbr", texels, fabric)
        print(f"| {preset} | openpbr | {plain.delta_e:.2f} | {plain.score:.2f} | | |", flush=True)
        s = surface_of("openpbr", plain.look, texels)
        parts = (
            s.base,
            s.ior[..., None],
            s.alpha_rough[..., None],
            s.alpha_smooth[..., None],
            s.tint,
        )
        means = [np.average(np.squeeze(one, 1), axis=0, weights=texels.weight) for one in parts]
        look = plain.look
        fuzz = [look.fuzz_weight, look.fuzz_roughness, *look.fuzz_color]
        for leans in (False, True):
            score, error, axis, x = best(
                Coated(texels, leans=leans), judge, np.concatenate((*means, fuzz))
            )
            base = np.degrees(x[19]) if leans else 0.0
            words = "both turned" if leans else "coat turned"
            where = f"{('weft', 'warp')[axis]} | {np.degrees(x[18]):.0f}, {base:.0f}"
            print(f"| {preset} | {words} | {error:.2f} | {score:.2f} | {where} |", flush=True)


if __name__ == "__main__":
    main()

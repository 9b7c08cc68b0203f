"""How near thin sheets come to cloth that is lit from behind, as Markdown.

    python bench/materials/bench_through.py [PRESET ...]

The fabrics are presets whose threads conserve energy, and the sheet is that of the mean of a
repeat. `map alone` and `fitted` are mean delta E 2000 over 16 views by 96 lights behind the cloth,
`sky` the mean relative difference of what comes through to the views in an even sky.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from fabricusd.appearance import surface
from fabricusd.fabric import Fabric
from fabricusd.materials.fit.fit import fit
from fabricusd.materials.fit.forward import forward_through, frames_of
from fabricusd.materials.fit.judge import albedo, direction_pairs
from fabricusd.materials.uniform import mean_sample
from fabricusd.schema import load

PRESETS = ("linen_plain", "silk_crepe_de_chine", "polyester_satin_charmeuse", "silk_shot")
KINDS = ("openpbr", "standard_surface")


def of_one_model(preset: str) -> Fabric:
    """The preset with threads that conserve energy, both sides alike."""
    return replace(load(preset), model="conserving", back=None)


def main() -> None:
    """Print a row for each preset and surface."""
    print("| fabric | surface | map alone | fitted | sky |")
    print("|---|---|---|---|---|")
    wi, wo = direction_pairs()
    wi = wi * (1.0, 1.0, -1.0)
    for preset in sys.argv[1:] or PRESETS:
        fabric = of_one_model(preset)
        texels = mean_sample(fabric)
        true = albedo(
            surface.evaluate(fabric, wi, wo, level="far", shadow=surface.mean_shadow(fabric))
        )
        i, o = (np.einsum("kab,nb->kna", frames_of(texels), w) for w in (wi, wo))
        for kind in KINDS:
            made = fit(kind, texels, fabric)
            scale = np.array(made.look.transmission_scale)
            got = albedo(scale * forward_through(kind, made.look, texels, i, o)[0])
            off = float(np.mean(np.abs(got / true - 1.0)))
            print(
                f"| {preset} | {kind} | {made.through_start_delta_e:.1f} "
                f"| {made.through_delta_e:.1f} | {100 * off:.0f} % |",
                flush=True,
            )


if __name__ == "__main__":
    main()

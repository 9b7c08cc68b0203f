"""How near a standard surface comes to each preset, with and without the fit.

    python bench/bench_fits.py [PRESET ...]

A square of each preset is baked so that a texel spans whole repeats, and at 8 texels a thread; each
surface is fitted to both. Delta E 2000 over pairs of directions of the hemisphere, in a light under
which a white diffuser is white; `albedo` is the mean relative difference of directional albedo.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from fabricusd.chart.materials import baked_texels
from fabricusd.preview.fit import fit
from fabricusd.schema import load

PRESETS = (
    "linen_plain", "silk_crepe_de_chine", "polyester_satin_charmeuse", "silk_shot", "velvet",
    "wool_flannel",
)  # fmt: skip
KINDS = ("preview", "openpbr", "principled")


def main() -> None:
    print("| preset | texels | surface | textures alone | fitted | 95th | albedo |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        for preset in sys.argv[1:] or PRESETS:
            for words, threads in (("of whole repeats", 6400.0), ("8 a thread", 8.0)):
                texels = baked_texels(load(preset), Path(name), threads)
                for kind in KINDS:
                    f = fit(kind, texels, load(preset))
                    print(
                        f"| {preset} | {words} | {kind} | {f.start_delta_e:.1f} | {f.delta_e:.1f} "
                        f"| {f.delta_e_95:.1f} | {100 * f.albedo:.0f} % |",
                        flush=True,
                    )


if __name__ == "__main__":
    main()

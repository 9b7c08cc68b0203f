"""The error of standard surfaces for each preset, with and without the fit.

    python bench/materials/bench_fits.py [PRESET ...]

A square of each preset is baked twice, so that a texel spans whole repeats and at 8 texels per
thread. Each surface is fitted to both. Where threads are resolved, it is also fitted to each thread
separately, with the fits in the textures, as `fabricusd material` writes them. Printed is delta E
2000 over pairs of directions of the hemisphere, in a light under which a white diffuser is white:
mean, 95th percentile, and the mean relative difference of directional albedo. `threads` is the mean
of OpenPBR over the texels of each thread.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from fabricusd.chart.panels.materials import baked_texels
from fabricusd.materials.fit.fit import Fitted, fit, fit_threads, with_threads
from fabricusd.schema import load

PRESETS = (
    "linen_plain", "silk_crepe_de_chine", "polyester_satin_charmeuse", "silk_shot", "velvet",
    "wool_flannel",
)  # fmt: skip
KINDS = ("preview", "openpbr", "principled")


def main() -> None:
    print("| preset | texels | textures alone | preview | openpbr | principled | threads |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        for preset in sys.argv[1:] or PRESETS:
            fabric = load(preset)
            for words, threads in (("of whole repeats", 6400.0), ("8 a thread", 8.0)):
                texels = baked_texels(fabric, Path(name), threads)
                show(preset, words, {kind: fit(kind, texels, fabric) for kind in KINDS})
                if texels.threads:
                    looks = {n: one.look for n, one in fit_threads(texels, fabric).items()}
                    own = with_threads(texels, looks)
                    made = {k: fit(k, own, fabric, baked=texels) for k in KINDS if k != "preview"}
                    show(preset, f"{words}, by thread", made)


def show(preset: str, words: str, made: dict[str, Fitted]) -> None:
    cells = [
        f"{f.delta_e:.1f}, {f.delta_e_95:.1f}, {100 * f.albedo:.0f} %" if f else ""
        for f in map(made.get, KINDS)
    ]
    one = made["openpbr"]
    threads = "" if one.threads_delta_e is None else f"{one.threads_delta_e:.1f}"
    row = (preset, words, f"{one.start_delta_e:.1f}", *cells, threads)
    print("|", " | ".join(row), "|", flush=True)


if __name__ == "__main__":
    main()

"""Shadow methods against tubes: how much of the light gets to the threads, and where.

    python bench/geometry/bench_shadows.py [--presets NAME ...] [--places N]

For places spread evenly over the threads that are seen from above, and 8 azimuths of the light: the
mean share of the light that arrives, by tubes (`geometry.lit_share`) and by each method at level
`weave`; in brackets the rms difference from the tubes, place by place. A method whose rms is larger
than that of `none` is marked: it is worse than no shadow. The tubes' share is itself a mean of 16
rays a place, which adds up to .1 to every rms. Threads are even.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.shadow.kinds import METHODS
from fabricusd.appearance.shadow.methods import compile_shadow, shadowing
from fabricusd.appearance.weave.compiled import compile_fabric, true_repeat
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.fabric import even
from fabricusd.geometry import lit_share, tubes
from fabricusd.schema import load

Floats = NDArray[np.float64]

PRESETS = (
    "linen_plain", "silk_crepe_de_chine", "polyester_satin_charmeuse", "silk_shot",
    "rayon_shantung", "wool_flannel", "denim", "cotton_poplin",
)  # fmt: skip
ELEVATIONS = (5, 10, 20, 30, 45, 60)
AZIMUTHS, RAYS = 8, 16
STEP = np.array([0.7548776662466927, 0.5698402909980532])
"""The plane's most even additive sequence [Roberts2018]."""


def light(elevation: float, azimuth: float) -> Floats:
    """(3,) unit direction; angles in degrees."""
    e, a = math.radians(elevation), math.radians(azimuth)
    return np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])


def rows(name: str, places: int) -> list[str]:
    """One row of the table for each elevation."""
    fabric = even(load(name))
    uv = (np.arange(places)[:, None] * STEP % 1.0) * true_repeat(fabric)
    cloth = tubes(fabric)
    compiled = compile_fabric(fabric, precision=np.float64)
    shadows = {m: compile_shadow(fabric, m, precision=np.float64) for m in METHODS}
    uv = uv[~lookup(fabric, uv).gap]
    found = []
    for elevation in ELEVATIONS:
        lights = [light(elevation, 360 * (a + 0.25) / AZIMUTHS) for a in range(AZIMUTHS)]
        true = lit_share(cloth, uv, np.array(lights), count=RAYS)
        seen = ~np.isnan(true)
        cells, none = [], math.inf
        for method in METHODS:
            g = np.array(
                [
                    shadowing(
                        fabric, np.tile(w, (len(uv), 1)), uv, compiled=(compiled, shadows[method])
                    )
                    for w in lights
                ]
            )
            rms = math.sqrt(float(((g - true)[seen] ** 2).mean()))
            none = rms if method == "none" else none
            worse = " worse than none" if rms > none else ""
            cells.append(f"{g[seen].mean():.2f} ({rms:.2f}){worse}")
        found.append(f"| {name} | {elevation}° | {true[seen].mean():.2f} | {' | '.join(cells)} |")
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presets", nargs="+", default=PRESETS)
    parser.add_argument("--places", type=int, default=3000)
    options = parser.parse_args()
    print("| preset | light | tubes | " + " | ".join(METHODS) + " |")
    print("|---" * (3 + len(METHODS)) + "|")
    for name in options.presets:
        for line in rows(name, options.places):
            print(line, flush=True)


if __name__ == "__main__":
    main()

"""Rays a second through the tubes of linen, and what the time goes into.

python bench/geometry/bench_paths.py
"""

from __future__ import annotations

import cProfile
import pstats
import time
from dataclasses import replace

import numpy as np

from fabricusd.geometry import albedo, reflectance, tubes
from fabricusd.geometry.tables import conserving
from fabricusd.schema import load

PATHS = 1 << 18
LIGHT, VIEW = np.array([0.48, 0.36, 0.8]), np.array([0.0, 0.6, 0.8])
PARTS = {
    "_intersect_packets": "Embree, nearest hits",
    "_occluded_packets": "Embree, shadows",
    "arrive": "threads' light",
    "go_on": "directions drawn",
    "new_packets": "room for rays",
}


def main() -> None:
    """Print the rates, in seconds of one core."""
    fabric = load("linen_plain")
    once = tubes(fabric)
    white = once.with_fabric(replace(conserving(fabric), name="white"))
    for name, run in (
        ("one scattering", lambda n: reflectance(once, np.tile(VIEW, (n, 1)), LIGHT, count=4096)),
        ("all, A = 1", lambda n: albedo(white, np.tile(VIEW, (n, 1)), count=4096)),
    ):
        run(1)
        profile = cProfile.Profile(time.process_time)
        begun = time.process_time()
        profile.enable()
        rays = run(PATHS // 4096).rays
        profile.disable()
        spent = time.process_time() - begun
        print(f"{name}: {rays / spent / 1e6:.2f} M rays/s, {spent / PATHS * 1e6:.2f} us a path")
        stats = pstats.Stats(profile).stats  # type: ignore[attr-defined]
        own = {key[2]: value[2] for key, value in stats.items()}
        shares = {label: own.get(part, 0.0) / spent for part, label in PARTS.items()}
        shares["the rest, in numpy"] = 1.0 - sum(shares.values())
        print("   " + ", ".join(f"{label} {share:.0%}" for label, share in shares.items()))


if __name__ == "__main__":
    main()

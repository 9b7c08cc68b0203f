"""Which surface law is nearest to a preset's tubes, and the albedos to wear it with.

python -m fabricusd.geometry.nearest [NAME ...] prints both. The law is judged on the pairs that are
not held out. The published `A` were tuned under the law `masked`: under another law they are scaled
by one factor, so that the cloth reflects as much of a white sky at 8 degrees as it did.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import laws, surface
from fabricusd.appearance.published.excess import white_sky
from fabricusd.fabric import Fabric
from fabricusd.geometry.judge import judge
from fabricusd.geometry.tables import table, table_names
from fabricusd.schema import load

Floats = NDArray[np.float64]

TIE = 0.01
"""Errors that differ by less than this are equal: the earlier law of PREFERRED is taken."""

PREFERRED = ("projected", "unmasked", "masked")

REC_709 = np.array([0.2126, 0.7152, 0.0722])


def law_errors(name: str) -> dict[str, float]:
    """Mean absolute error over mean of each law, on the pairs that are not held out."""
    found, fabric = table(name), load(name)
    return {
        law: judge(
            found,
            surface.evaluate(
                replace(fabric, surface_law=law), found.wi, found.wo, shadow="horizon"
            ),
            ~found.held_out,
        ).error
        for law in laws.REGISTRY
    }


def nearest(errors: dict[str, float]) -> str:
    """The law with the least error."""
    least = min(errors.values())
    return next(law for law in PREFERRED if errors[law] < least + TIE)


def scaled(fabric: Fabric, factor: float) -> Fabric:
    """`fabric` with `A` of every thread times `factor`."""
    threads = {
        name: replace(t, albedo=(factor * t.albedo[0], factor * t.albedo[1], factor * t.albedo[2]))
        for name, t in fabric.threads.items()
    }
    return replace(fabric, threads=threads)


def refit(fabric: Fabric, law: str) -> float:
    """The factor of `A` with which `fabric` under `law` is as bright as it is under `masked`."""
    asked = _luminance(replace(fabric, surface_law="masked"))
    worn = replace(fabric, surface_law=law)
    black, whole = _luminance(scaled(worn, 0.0)), _luminance(worn)
    return max(0.0, (asked - black) / (whole - black))


def _luminance(fabric: Fabric) -> float:
    """Luminance at 8 degrees under a white sky, the mean over four azimuths."""
    sky, weight = white_sky()
    total = 0.0
    for turn in (0.0, 45.0, 90.0, 135.0):
        a, polar = math.radians(turn), math.radians(8.0)
        wo = np.array(
            [math.sin(polar) * math.cos(a), math.sin(polar) * math.sin(a), math.cos(polar)]
        )
        value = surface.evaluate(fabric, sky, wo, shadow="horizon")
        total += float(weight @ value @ REC_709) / 4.0
    return total


def main() -> int:
    """Print each preset's law, errors and factor."""
    for name in sys.argv[1:] or table_names():
        errors = law_errors(name)
        law = nearest(errors)
        told = ", ".join(f"{k} {v:.3f}" for k, v in errors.items())
        print(f"{name}: {law} ({told}), A times {refit(load(name), law):.3f}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

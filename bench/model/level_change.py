"""Where `auto` should change from level `weave` to `far`: the error of each by width of a pixel.

    python bench/model/level_change.py [PRESET ...]

The cloth is flat and the camera rolled. Errors are relative to the cloth's mean, root mean squares
over three lights, and measured against the cloth's spectrum below the picture's Nyquist frequency
(`chart.cloth_picture`). `weave` is given twice: as the mean over 8 x 8 places per pixel, and with
the noise that 64 samples leave.
"""

from __future__ import annotations

import argparse

import numpy as np

from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.chart.cloth_picture import difference, ideal_spectrum, picture, view_of
from fabricusd.chart.level_errors import LIGHTS, TO_EYE, zoom
from fabricusd.fabric import even
from fabricusd.schema import load, published_names

REPEATS = (0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.6, 0.8)
SAMPLES = 64


def main() -> None:
    """Print a table for every preset: repeats per pixel, and the errors of the levels."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("presets", nargs="*", default=published_names())
    names = parser.parse_args().presets
    print("| preset, level | " + " | ".join(f"{r:g}" for r in REPEATS) + " |")
    print("|---" * (1 + len(REPEATS)) + "|")
    for name in names:
        fabric = even(load(name))
        widths = np.array(REPEATS) * max(true_repeat(fabric))
        far, weave, inside = [], [], []
        for light in LIGHTS:
            views = [view_of(fabric, width, light) for width in widths]
            ideals = [ideal_spectrum(view) for view in views]
            both = list(zip(views, ideals, strict=True))
            far.append([difference(picture(v, "far", 1), i).total for v, i in both])
            weave.append([difference(picture(v, "weave", 8), i).total for v, i in both])
            inside.append(zoom(fabric, widths, light, TO_EYE, "none").inside[:, 1])
        f, w, noise = (np.sqrt(np.mean(np.square(x), axis=0)) for x in (far, weave, inside))
        noisy = np.hypot(w, noise / SAMPLES**0.5)
        for level, row in {"far": f, "weave": w, f"weave, {SAMPLES} samples": noisy}.items():
            print(f"| {name}, {level} | " + " | ".join(f"{x:.2f}" for x in row) + " |")


if __name__ == "__main__":
    main()

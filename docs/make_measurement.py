"""Draw the pictures of docs/measurement_error.md: a thread through the simulated gantry and back.

python docs/make_measurement.py
"""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from fabricusd.appearance.thread import evaluate
from fabricusd.measure import DESIGNS, Lobes, fit_thread, measure, simulate
from fabricusd.measure.plots.draw import draw_all
from fabricusd.schema import load

IMAGES = Path(__file__).parent / "images"
MODEL = "microcylinder"
SHOWN = (0, 32, 64)
"""Incidences of the hemispheres [degrees]."""


def kept(folder: Path, name: str) -> None:
    """Move one plot out of a folder into the docs."""
    shutil.copy(folder / f"{name}.png", IMAGES / f"measurement_{name}.png")


def main() -> None:
    """Photograph rayon in the plane; draw silk over the half sphere, with noise of 3 %."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rayon = load("thread_rayon_spun{appearance=published}").thread_list[0]
        simulate(rayon, folder / "shoot", name="spun rayon")
        lobes = measure(folder / "shoot").lobes
        draw_all(lobes, fit_thread(lobes, MODEL), folder / "plots")
        kept(folder / "plots", "polar")

        silk = load("thread_silk_filament{appearance=published}").thread_list[0]
        theta_i, theta_o, phi_d = DESIGNS["half"]()
        chosen = np.isin(np.degrees(theta_i).round(), SHOWN)
        angles = {"theta_i": theta_i[chosen], "theta_o": theta_o[chosen], "phi_d": phi_d[chosen]}
        one = np.ones((int(chosen.sum()), 3))
        lobes = Lobes(**angles, f=one, sigma=one, name="silk filament")
        f = evaluate(silk, lobes.wi, lobes.wo, MODEL)
        sigma = np.sqrt((0.03 * f) ** 2 + 0.002**2)
        noise = np.random.default_rng(0).standard_normal(f.shape)
        lobes = replace(lobes, f=f + sigma * noise, sigma=sigma)
        draw_all(lobes, fit_thread(lobes, MODEL), folder / "silk")
        kept(folder / "silk", "hemispheres")


if __name__ == "__main__":
    main()

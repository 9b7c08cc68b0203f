"""Draw the figures of docs/appearance.md: threads and cylinders in polar plots, radius in decades.

python docs/make_figures.py
"""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from fabricusd.appearance import surface, thread
from fabricusd.fabric import Fabric
from fabricusd.schema import load

HERE = Path(__file__).resolve().parent
PRESETS = (
    "linen_plain", "silk_crepe_de_chine", "polyester_satin_charmeuse",
    "polyester_satin_charmeuse_back", "silk_shot", "velvet",
)  # fmt: skip
INCIDENCE = (15, 30, 60)
DECADES = (-3.0, 1.0)
WRAPS = {"vertical": 0.0, "diagonal": 45.0, "horizontal": 90.0}


def decades(value: np.ndarray) -> np.ndarray:
    """Radius of a value: its decades above the floor, and 0 at or below the floor."""
    floor, _ = DECADES
    return np.maximum(np.log10(np.maximum(value, 1e-12)) - floor, 0.0)


def polar(axes: plt.Axes, title: str) -> None:
    """Draw a half disc with a ring for each decade."""
    floor, top = DECADES
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    axes.set_thetamin(-90)
    axes.set_thetamax(90)
    axes.set_ylim(0, top - floor)
    axes.set_thetagrids([-90, -45, 45, 90])
    rings = np.arange(1, int(top - floor) + 1)
    labels = [f"$10^{{{int(floor) + k}}}$" if k % 2 else "" for k in rings]
    axes.set_yticks(rings, labels)
    axes.tick_params(labelsize=6, pad=-1)
    axes.set_title(title, fontsize=7, y=0.82)


def thread_plots() -> None:
    """Draw f_s of each preset's threads in the plane of incidence, as the mean of the channels."""
    figure = plt.figure(figsize=(12, 3.6))
    view = np.radians(np.linspace(-89, 89, 713))
    wo = np.stack((np.sin(view), np.zeros_like(view), np.cos(view)), axis=-1)
    for column, name in enumerate(PRESETS):
        fabric = load(name)
        for row, (label, one) in enumerate(list(fabric.threads.items())[:2]):
            title = f"{name}\n{label}"
            axes = figure.add_subplot(2, 6, row * 6 + column + 1, projection="polar")
            polar(axes, title)
            for incidence in INCIDENCE:
                angle = math.radians(incidence)
                wi = np.array([math.sin(angle), 0.0, math.cos(angle)])
                value = thread.evaluate(one, wi, wo, model="microcylinder").mean(axis=1)
                axes.plot(view, decades(value), lw=0.8, label=f"{incidence}°")
            if row == column == 0:
                axes.legend(fontsize=5, loc="lower center", ncol=3)
    figure.subplots_adjust(left=0.02, right=0.98, top=1.0, bottom=0.0, hspace=-0.25, wspace=0.3)
    figure.savefig(HERE / "images" / "threads.png", dpi=110, bbox_inches="tight")
    plt.close(figure)


def cylinder(fabric: Fabric, wrap: float, lights: np.ndarray) -> np.ndarray:
    """(lights, places) radiance across the visible half of a cylinder, per distant light [rad].

    The axis of the cylinder is upright. The viewer looks along its normal plane, and the light
    goes round it in that plane. At `wrap` 0 degrees the warp runs along the axis.
    """
    # Midpoints of equal parts of the projected width of the visible half.
    place = np.arcsin((np.arange(181) + 0.5) / 181 * 2 - 1)
    turn = math.radians(wrap)
    profile = np.empty((len(lights), len(place)))
    for k, light in enumerate(lights):
        to_eye = np.stack((np.sin(-place), np.zeros_like(place), np.cos(place)), axis=-1)
        to_light = np.stack(
            (np.sin(light - place), np.zeros_like(place), np.cos(light - place)), axis=-1
        )
        pair = []
        for w in (to_light, to_eye):
            u = math.cos(turn) * w[:, 0]
            v = math.sin(turn) * w[:, 0]
            pair.append(np.stack((u, v, w[:, 2]), axis=-1))
        profile[k] = surface.evaluate(
            fabric, pair[0], pair[1], level="far", shadow=surface.mean_shadow(fabric)
        ).mean(axis=1)
    return profile


def cylinder_plots() -> None:
    """Draw each preset on a cylinder, wrapped three ways, by the angle between light and viewer."""
    figure = plt.figure(figsize=(12, 3.4))
    lights = np.radians(np.linspace(-88, 88, 89))
    for column, name in enumerate(PRESETS):
        axes = figure.add_subplot(2, 6, column + 1, projection="polar")
        polar(axes, name)
        across = figure.add_subplot(2, 6, column + 7)
        across.tick_params(labelsize=6)
        across.set_xlabel("across the cylinder, lit from the viewer", fontsize=6)
        for label, wrap in WRAPS.items():
            profile = cylinder(load(name), wrap, lights)
            axes.plot(lights, decades(profile.mean(axis=1)), lw=0.8)
            x = (np.arange(profile.shape[1]) + 0.5) / profile.shape[1] * 2 - 1
            across.plot(x, profile[len(lights) // 2], lw=0.8, label=label)
        across.set_ylim(0, None)
        if column == 0:
            across.legend(fontsize=5, loc="lower center")
    figure.tight_layout()
    figure.savefig(HERE / "images" / "cylinders.png", dpi=110, bbox_inches="tight")
    plt.close(figure)


if __name__ == "__main__":
    (HERE / "images").mkdir(exist_ok=True)
    thread_plots()
    cylinder_plots()

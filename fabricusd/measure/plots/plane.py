"""Lobes in the plane of light and thread: polar and logarithmic, and against the camera's angle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.thread import evaluate
from fabricusd.measure.angles import DEGREE, direction
from fabricusd.measure.fit.result import Fitted
from fabricusd.measure.lobes import Lobes

Floats = NDArray[np.float64]

COLORS = ("#c1272d", "#3a7d2c", "#2b4fa3")
CHANNELS = ("red", "green", "blue")
COLUMNS = 4
DECADES = 3
"""Most decades below the largest value that a plot shows."""


def incidences(lobes: Lobes) -> Floats:
    """(k,) incidences with views in the plane, thinned to what fits on a page [rad]."""
    flat = lobes.of(lobes.phi_d < 0.01 * DEGREE).incidences
    most = 2 * COLUMNS
    if len(flat) <= most:
        return flat
    return np.asarray(flat[np.linspace(0, len(flat) - 1, most).round().astype(int)])


def draw_polar(plt: Any, lobes: Lobes, fit: Fitted) -> Any:
    """Figures 3.11 and 4.2: the mean of the channels, its logarithm as radius, by incidence."""
    which = incidences(lobes)
    lines, columns = _layout(len(which))
    figure = plt.figure(figsize=(4.0 * columns, 0.8 + 2.5 * lines), layout="constrained")
    figure.suptitle(_title(lobes, fit, "polar, logarithmic, mean of red, green and blue"))
    top, low = _range(lobes)
    # The centre lies below the least value, so that a dim floor has a shape.
    low /= 3.0
    decades = np.log10(top / low)
    for k, incidence in enumerate(which):
        axes = figure.add_subplot(lines, columns, k + 1, projection="polar")
        seen, theta, curve = _in_plane(lobes, fit, float(incidence))

        def radius(f: Floats) -> Floats:
            return np.log10(np.maximum(f, low) / low)

        axes.plot(seen.theta_o, radius(seen.f.mean(axis=1)), "o", ms=2.6, color="0.35", mew=0)
        axes.plot(theta, radius(curve.mean(axis=1)), "-", lw=1.3, color="#d4661f")
        for angle, style in ((incidence, "-"), (-incidence, "--")):
            axes.plot([angle, angle], [0, decades], style, lw=0.7, color="0.6")
        axes.set_theta_zero_location("N")
        axes.set_theta_direction(-1)
        axes.set_thetamin(-90)
        axes.set_thetamax(90)
        axes.set_thetagrids(np.arange(-90, 91, 30))
        axes.set_rlim(0, decades)
        ticks = np.arange(np.ceil(np.log10(low)), np.log10(top) + 1e-9)
        axes.set_rticks(ticks - np.log10(low), [f"{10**t:g}" for t in ticks], fontsize=6)
        axes.tick_params(labelsize=6)
        axes.set_title(f"light at {incidence / DEGREE:.3g} deg", fontsize=8, pad=-12)
    figure.supxlabel(_legend(), fontsize=7)
    return figure


def draw_plane(plt: Any, lobes: Lobes, fit: Fitted) -> Any:
    """Each channel against the camera's inclination, measured and fitted, by incidence."""
    which = incidences(lobes)
    lines, columns = _layout(len(which))
    figure, plots = plt.subplots(
        lines, columns, figsize=(3.3 * columns, 0.8 + 2.5 * lines), layout="constrained",
        sharex=True, sharey=True, squeeze=False,
    )  # fmt: skip
    figure.suptitle(_title(lobes, fit, "in the plane of light and thread"))
    top, low = _range(lobes)
    for axes in plots.ravel()[len(which) :]:
        axes.set_visible(False)
    for axes, incidence in zip(plots.ravel(), which, strict=False):
        seen, theta, curve = _in_plane(lobes, fit, float(incidence))
        for c, color in enumerate(COLORS):
            axes.errorbar(
                seen.theta_o / DEGREE, np.maximum(seen.f[:, c], 0.5 * low), yerr=seen.sigma[:, c],
                fmt="o", ms=2.2, mew=0, lw=0.5, color=color, alpha=0.7,
            )  # fmt: skip
            axes.plot(theta / DEGREE, curve[:, c], lw=1.0, color=color, label=CHANNELS[c])
        axes.axvline(-incidence / DEGREE, lw=0.7, ls="--", color="0.6")
        axes.set_yscale("log")
        axes.set_ylim(low, top)
        axes.set_xlim(-90, 90)
        axes.set_xticks(np.arange(-90, 91, 30))
        axes.tick_params(labelsize=7)
        axes.set_title(f"light at {incidence / DEGREE:.3g} deg", fontsize=8)
    for axes in plots[:, 0]:
        axes.set_ylabel("f_s [1/sr]" if lobes.absolute else "f_s, relative", fontsize=8)
    for axes in plots[-1]:
        axes.set_xlabel("camera, theta_o [deg]", fontsize=8)
    figure.text(0.995, 0.005, "dots measured, lines fitted; dashed: mirror direction", ha="right",
                va="bottom", fontsize=7)  # fmt: skip
    return figure


def _in_plane(lobes: Lobes, fit: Fitted, incidence: float) -> tuple[Lobes, Floats, Floats]:
    """(views, inclinations of a curve, (n, 3) the fitted curve times the gain)."""
    near = np.abs(lobes.theta_i - incidence) < 0.01 * DEGREE
    seen = lobes.of(near & (lobes.phi_d < 0.01 * DEGREE))
    theta = np.linspace(-85.0, 85.0, 681) * DEGREE
    curve = predicted(fit, np.full_like(theta, incidence), theta, np.zeros_like(theta))
    return seen, theta, curve


def predicted(fit: Fitted, theta_i: Floats, theta_o: Floats, phi_d: Floats) -> Floats:
    """(n, 3) lobes as the fit has them, its gain included."""
    gain = fit.estimates["gain"].value if "gain" in fit.estimates else 1.0
    wi, wo = direction(theta_i, 0.0), direction(theta_o, phi_d)
    return gain * evaluate(fit.thread, wi, wo, fit.model)


def _layout(count: int) -> tuple[int, int]:
    """(lines, columns) of so many plots, as few empty ones as can be."""
    lines = -(-count // COLUMNS)
    return lines, -(-count // lines)


def _range(lobes: Lobes) -> tuple[float, float]:
    """(largest, smallest) value that a plot shows."""
    top = 1.4 * float(lobes.f.max())
    positive = lobes.f[lobes.f > 0]
    low = float(positive.min()) if positive.size else top / 10
    return top, max(0.8 * low, top / 10**DECADES)


def _title(lobes: Lobes, fit: Fitted, what: str) -> str:
    return f"{lobes.name}: {what} ({fit.model}, chi2/n {fit.chi2:.3g})"


def _legend() -> str:
    return "dots measured, line fitted; light along the solid ray, its mirror along the dashed one"

"""Figures 3.13 and 3.14: back and forward hemispheres, measured above fitted."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.measure.angles import DEGREE
from fabricusd.measure.fit.result import Fitted
from fabricusd.measure.interpolate import interpolated
from fabricusd.measure.lobes import Lobes
from fabricusd.measure.plots.plane import COLUMNS, predicted

Floats = NDArray[np.float64]

SIDE = 121
"""Pixels of a hemisphere."""
GAMMA = 2.2
BRIGHTEST = 99.0
"""Percentile of the values that is drawn as white; a few highlights would darken all others."""


def draw_hemispheres(plt: Any, lobes: Lobes, fit: Fitted, method: str = "ratio") -> Any:
    """Colours of the lobes over each hemisphere, projected onto the thread's tangent plane, with
    the thread vertical. One column per incidence, each with a scale of its own."""
    counts = [np.unique(lobes.phi_d[np.abs(lobes.theta_i - i) < 0.01 * DEGREE]).size
              for i in lobes.incidences]  # fmt: skip
    which = lobes.incidences[np.array(counts) > 2]
    if len(which) > COLUMNS:
        which = which[np.linspace(0, len(which) - 1, COLUMNS).round().astype(int)]
    rows = ("back, measured", "back, fitted", "forward, measured", "forward, fitted")
    figure, plots = plt.subplots(
        4, len(which), figsize=(0.5 + 2.2 * len(which), 8.6), layout="constrained", squeeze=False
    )
    figure.suptitle(
        f"{lobes.name}: hemispheres, thread upright, a scale per column\n"
        f"({fit.model}, chi2/n {fit.chi2:.3g})", fontsize=10,
    )  # fmt: skip
    for k, incidence in enumerate(which):
        here = np.abs(lobes.theta_i - incidence) < 0.01 * DEGREE
        white = max(float(np.percentile(lobes.f[here], BRIGHTEST)), 1e-12)
        for r, forward in enumerate((False, True)):
            theta, phi, inside = _hemisphere(forward)
            pictures = (
                interpolated(
                    lobes,
                    float(incidence),
                    theta,
                    phi,
                    method=method,
                    thread=fit.thread,
                    model=fit.model,
                ),
                predicted(fit, np.full_like(theta, incidence), theta, phi),
            )
            for n, values in enumerate(pictures):
                axes = plots[2 * r + n, k]
                picture = np.ones((SIDE * SIDE, 4))
                picture[:, :3] = np.clip(values / white, 0, 1) ** (1 / GAMMA)
                picture[:, 3] = inside.ravel()
                axes.imshow(picture.reshape(SIDE, SIDE, 4), extent=(-1, 1, -1, 1))
                axes.set_xticks([])
                axes.set_yticks([])
                for spine in axes.spines.values():
                    spine.set_visible(False)
                if not forward:
                    axes.plot(0, np.sin(incidence), "+", color="0.5", ms=6)
                if k == 0:
                    axes.set_ylabel(rows[2 * r + n], fontsize=8)
        plots[0, k].set_title(f"light at {incidence / DEGREE:.3g} deg (+)", fontsize=8)
    return figure


def _hemisphere(forward: bool) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """(theta_o (n,), phi_d (n,), (SIDE, SIDE) which pixels lie on it), top row along the thread."""
    at = (np.arange(SIDE) + 0.5) / SIDE * 2 - 1
    across, along = np.meshgrid(at, -at)
    inside = across**2 + along**2 < 0.999
    along, across = np.where(inside, along, 0.0), np.where(inside, across, 0.0)
    theta = np.arcsin(along).ravel()
    cos = np.sqrt(1 - along**2).ravel()
    phi = np.arcsin(np.clip(np.abs(across.ravel()) / cos, 0, 1))
    return theta, np.pi - phi if forward else phi, inside

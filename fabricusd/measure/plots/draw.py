"""The plots of the thesis's Figures 3.10 to 3.14, 4.2 and 4.3, as PNG and SVG."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fabricusd.errors import FabricError
from fabricusd.files import whole_file
from fabricusd.measure.angles import DEGREE
from fabricusd.measure.fit.result import Fitted
from fabricusd.measure.lobes import Lobes
from fabricusd.measure.plots.hemispheres import draw_hemispheres
from fabricusd.measure.plots.plane import draw_plane, draw_polar

DOTS = 110


def pyplot() -> Any:
    """matplotlib's pyplot, without a display; raises FabricError if it is not installed."""
    try:
        import matplotlib
    except ImportError:
        raise FabricError(
            "--plots", "needs matplotlib, which is not installed; run pip install 'fabricusd[docs]'"
        ) from None
    matplotlib.use("Agg")
    # Makes the same drawing produce the same file.
    matplotlib.rcParams["svg.hashsalt"] = "fabricusd"
    import matplotlib.pyplot

    return matplotlib.pyplot


def require_folder(folder: str | os.PathLike[str]) -> None:
    """Raise FabricError if plots could not be written into `folder`, or not be drawn at all."""
    pyplot()
    target = Path(folder)
    if os.path.lexists(target) and not os.path.isdir(target):
        raise FabricError(str(target), "is a file; it must be a folder for the plots")
    if not os.path.isdir(target.parent):
        raise FabricError(
            str(target), f"is in '{target.parent}', which is not a directory; create it first"
        )


def draw_all(
    lobes: Lobes, fit: Fitted, folder: str | os.PathLike[str], *, method: str = "ratio"
) -> list[Path]:
    """Draw every plot that the lobes have views for; return the files, a PNG and an SVG each.

    method : by which hemispheres are interpolated, see `interpolate.interpolated`
    """
    require_folder(folder)
    target = Path(folder)
    try:
        target.mkdir(exist_ok=True)
    except OSError as error:
        raise FabricError(str(target), f"cannot be made: {error.strerror}") from error
    drawn: list[tuple[str, Callable[[Any, Lobes, Fitted], Any]]] = []
    if (lobes.phi_d < 0.01 * DEGREE).any():
        drawn += [("polar", draw_polar), ("incidence_plane", draw_plane)]
    if len(np.unique(np.round(lobes.phi_d, 4))) > 2:
        drawn.append(("hemispheres", partial(draw_hemispheres, method=method)))
    written = []
    for name, draw in drawn:
        figure = draw(pyplot(), lobes, fit)
        for suffix in (".png", ".svg"):
            path = target / f"{name}{suffix}"
            with whole_file(path) as temporary:
                metadata = {"Date": None} if suffix == ".svg" else None
                figure.savefig(temporary, dpi=DOTS, metadata=metadata)
            written.append(path)
        pyplot().close(figure)
    return written

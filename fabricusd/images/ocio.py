"""Views of OpenColorIO configs, through the OpenColorIO that comes with OpenImageIO."""

from __future__ import annotations

from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from fabricusd.errors import FabricError, did_you_mean, one_line

LINEAR = "lin_rec709"
"""The colour space of every rendering, by the alias that configs give it."""


def require_view(config: str, view: str, where: str) -> None:
    """Raise FabricError, naming `where`, unless the config and its view exist."""
    _display_and_view(_config(config, where), view, where)


def displayed(light: NDArray[np.float64], config: str, view: str) -> NDArray[np.float64]:
    """(..., 3) linear Rec. 709 -> (..., 3) code values of the view's display.

    config, view : see `images.view.View`
    """
    display, name = _display_and_view(_config(config, "--view"), view, "--view")
    flat = np.ascontiguousarray(light.reshape(-1, 1, 3), np.float32)
    result: Any = oiio.ImageBufAlgo.ociodisplay(
        oiio.ImageBuf(flat), display, name, LINEAR, "", False, False, "", "", config
    )
    if result.has_error:
        raise FabricError(
            f"--view ocio {config}:{view}",
            f"cannot be applied: {one_line(str(result.geterror()), 200)}",
        )
    return np.asarray(result.get_pixels(oiio.FLOAT), np.float64).reshape(light.shape)


def _config(name: str, where: str) -> Any:
    config: Any = oiio.ColorConfig(name)
    reason = one_line(str(config.geterror()), 200)
    if reason or not config.getDisplayNames():
        raise FabricError(
            where,
            f"names the OpenColorIO config '{one_line(name, 80)}', which cannot be used: "
            f"{reason or 'it has no display'}",
        )
    if config.resolve(LINEAR) not in config.getColorSpaceNames():
        raise FabricError(
            where,
            f"names the OpenColorIO config '{one_line(name, 80)}', which has no colour space "
            f"{LINEAR}, that of the pictures",
        )
    return config


def _display_and_view(config: Any, view: str, where: str) -> tuple[str, str]:
    displays = list(config.getDisplayNames())
    display, slash, name = view.rpartition("/")
    if not slash or display not in displays:
        display, name = config.getDefaultDisplayName(), view
    views = list(config.getViewNames(display))
    if not name:
        return display, str(config.getDefaultViewName(display))
    if name not in views:
        raise FabricError(
            where,
            f"has the view '{one_line(name, 60)}'{did_you_mean(name, views)}; of '{display}' it "
            "must be one of "
            f"{', '.join(views)}",
        )
    return display, name

"""Views: from scene-linear radiance, Rec. 709, to the 8-bit sRGB of a picture that people look at.

`neutral`, the default, is Khronos PBR Neutral [KhronosNeutral2024], made to keep a product's
colours under ordinary light: it changes nothing up to a radiance of 0.8, and brings what is
brighter below 1 without a change of hue. `srgb` clips instead. `aces` is the fit of the ACES
reference rendering by [Narkowicz2015], scaled so that middle grey stays. `ocio` is a view of an
OpenColorIO config.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError, one_line
from fabricusd.srgb import srgb_encode

GREY = 0.18

MOST_STOPS = 500.0
"""Largest exposure in either direction [stops]: 2 to this power times any float32 is a finite
float64."""

BRIGHTEST = 1e6
"""Radiance beyond which every view is as bright as it gets, +inf included."""

FORM = "neutral, srgb, aces, or 'ocio CONFIG[:VIEW]'"

_FRESNEL = 0.0
"""Khronos subtracts 0.04, what a dielectric reflects of a white sky over the colour of its
material. Here a cloth's colour is what is measured of it, reflection included, so nothing is
subtracted; with 0.04, middle grey would show as 0.14 and a dark cloth of 0.02 as 0.0025."""

_START = 0.8 - _FRESNEL
_DESATURATION = 0.15
_A, _B, _C, _D, _E = 2.51, 0.03, 2.43, 0.59, 0.14

Pixels = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class View:
    """A view by its name; `config` and `view` are those of OpenColorIO.

    config : file name, or a name that OpenColorIO knows, such as ocio://default
    view : VIEW or DISPLAY/VIEW of that config; "" for its default
    """

    name: str = "neutral"
    config: str = ""
    view: str = ""

    def __str__(self) -> str:
        if self.name != "ocio":
            return self.name
        return f"ocio {self.config}" + (f":{self.view}" if self.view else "")


def parse_view(text: str, where: str = "--view") -> View:
    """`neutral`, `srgb`, `aces`, `ocio CONFIG[:VIEW]` -> View; the config is opened.

    Raises FabricError, naming `where`, for anything else, and for a config or a view that is not
    one.
    """
    name, _, rest = text.strip().partition(" ")
    name, rest = name.lower(), rest.strip()
    if name in _CURVES and not rest:
        return View(name=name)
    if name != "ocio" or not rest:
        raise FabricError(where, f"is '{one_line(text, 60)}'; it must be {FORM}")
    config, colon, view = rest.rpartition(":")
    # The colon of `ocio://default`, and one after a drive, are parts of the config's name.
    if not colon or view.startswith("//") or (len(config) == 1 and config.isalpha()):
        config, view = rest, ""
    if not colon or os.path.exists(rest):
        config, view = rest, ""
    from fabricusd.images.ocio import require_view

    found = View(name="ocio", config=config, view=view.strip())
    require_view(found.config, found.view, where)
    return found


def encode(
    radiance: NDArray[Any], exposure: float = 0.0, view: View | None = None
) -> NDArray[np.uint8]:
    """Encode (..., 3) radiance as 8-bit sRGB; `exposure` in stops. NaN is black."""
    # A camera in a file may have any exposure. Beyond the limit every pixel is white or black.
    stops = min(max(exposure, -MOST_STOPS), MOST_STOPS)
    light = np.nan_to_num(np.asarray(radiance, np.float64) * 2.0**stops, nan=0.0, posinf=BRIGHTEST)
    light = np.clip(light, 0.0, BRIGHTEST)
    view = view or View()
    if view.name == "ocio":
        from fabricusd.images.ocio import displayed

        code = displayed(light, view.config, view.view)
    else:
        code = srgb_encode(_CURVES[view.name](light))
    return np.asarray(np.round(np.clip(code, 0.0, 1.0) * 255.0), np.uint8)


def neutral(light: Pixels) -> Pixels:
    """Map (..., 3) linear radiance to linear display light in [0, 1] [KhronosNeutral2024].

    The identity where the largest channel is at most 0.8. Beyond, that channel is compressed along
    a hyperbola that continues the identity smoothly, the others keep their ratio to it, and all
    move toward it by a share that grows with the light that was taken away.
    """
    peak = light.max(axis=-1, keepdims=True)
    over = np.maximum(peak, _START)
    room = 1.0 - _START
    compressed = 1.0 - room**2 / (over + room - _START)
    white = 1.0 - 1.0 / (_DESATURATION * (over - compressed) + 1.0)
    mapped = light * (compressed / over) * (1.0 - white) + compressed * white
    return np.asarray(np.where(peak <= _START, light, mapped))


def srgb(light: Pixels) -> Pixels:
    """Clip to [0, 1]: exact where nothing is brighter than white."""
    return np.asarray(np.clip(light, 0.0, 1.0))


def aces(light: Pixels) -> Pixels:
    """The curve of [Narkowicz2015] for each channel, with 0.18 at 0.18."""
    x = np.minimum(_SCALE * light, BRIGHTEST)
    return np.asarray(np.clip(x * (_A * x + _B) / (x * (_C * x + _D) + _E), 0.0, 1.0))


def _grey_scale() -> float:
    """The exposure at which the ACES curve maps GREY to GREY: the root of its quadratic."""
    a, b, c = _A - GREY * _C, _B - GREY * _D, -GREY * _E
    return float((-b + np.sqrt(b * b - 4 * a * c)) / (2 * a) / GREY)


_SCALE = _grey_scale()
_CURVES: dict[str, Callable[[Pixels], Pixels]] = {"neutral": neutral, "srgb": srgb, "aces": aces}

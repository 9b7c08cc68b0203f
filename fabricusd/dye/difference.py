"""Lab under D65, the difference of two colours, and the nearest colour within reach."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize

from fabricusd.srgb import srgb_encode

Floats = NDArray[np.float64]


def lab(color: ArrayLike) -> Floats:
    """(..., 3) linear Rec. 709 of any range -> (..., 3) CIE L*a*b* under D65, not clipped."""
    colour = colour_science()
    space = colour.RGB_COLOURSPACES["ITU-R BT.709"]
    xyz = colour.RGB_to_XYZ(np.asarray(color, np.float64), space)
    return np.asarray(colour.XYZ_to_Lab(xyz, space.whitepoint), np.float64)


def difference(color: ArrayLike, reference: ArrayLike) -> Floats:
    """(...) CIE delta E 2000 of (..., 3) linear Rec. 709 colours of any range. [Sharma2005]"""
    colour = colour_science()
    return np.asarray(colour.difference.delta_E_CIE2000(lab(color), lab(reference)), np.float64)


def nearest(color: Floats, low: Floats, high: Floats) -> Floats:
    """The colour from `low` to `high` with the smallest delta E 2000 from `color`, each (3,)."""
    start = np.clip(color, low, high)
    # Perceived differences are nearer to even in the cube root of linear light.
    span = [tuple(np.cbrt(ends)) for ends in zip(low, high, strict=True)]
    found = minimize(
        lambda root: float(difference(root**3, color)),
        np.cbrt(start), bounds=span, method="L-BFGS-B", options={"eps": 1e-5},
    )  # fmt: skip
    best = np.clip(found.x**3, low, high)
    return best if difference(best, color) < difference(start, color) else start


def code(color: ArrayLike) -> str:
    """`#rrggbb` of a linear Rec. 709 colour, clipped to what sRGB holds."""
    codes = np.rint(srgb_encode(np.asarray(color, np.float64)) * 255)
    return "#" + "".join(f"{int(c):02x}" for c in codes)


def colour_science() -> Any:
    """The module colour-science, without its warning that it cannot plot without matplotlib."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour

"""The perceived difference of two colours, CIE delta E 2000. [Sharma2005]"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def lab(color: ArrayLike) -> NDArray[np.float64]:
    """(..., 3) linear Rec. 709, clipped to a display's range, 0 to 1 -> (..., 3) CIE L*a*b*."""
    colour = _colour()
    space = colour.RGB_COLOURSPACES["ITU-R BT.709"]
    shown = np.clip(np.asarray(color, np.float64), 0.0, 1.0)
    found = colour.XYZ_to_Lab(colour.RGB_to_XYZ(shown, space), space.whitepoint)
    return np.asarray(found, np.float64)


def delta_e_2000(color: ArrayLike, reference: ArrayLike) -> NDArray[np.float64]:
    """(...) CIE 2000 colour difference of two (..., 3) arrays of linear Rec. 709 display colours.

    Colours are clipped to the range of a display, 0 to 1.
    """
    colour = _colour()
    return np.asarray(colour.difference.delta_E_CIE2000(lab(color), lab(reference)), np.float64)


def _colour() -> Any:
    """The module colour-science, without its warning that it cannot plot without matplotlib."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour

"""How different two colours look: CIE delta E 2000 [Sharma2005]."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def delta_e_2000(color: ArrayLike, reference: ArrayLike) -> NDArray[np.float64]:
    """(...) CIE 2000 colour difference of two (..., 3) arrays of linear Rec. 709 display colours.

    Colours are clipped to what a display shows, 0 to 1.
    """
    import colour

    space = colour.RGB_COLOURSPACES["ITU-R BT.709"]
    lab = [
        colour.XYZ_to_Lab(
            colour.RGB_to_XYZ(np.clip(np.asarray(values, np.float64), 0.0, 1.0), space),
            space.whitepoint,
        )
        for values in (color, reference)
    ]
    return np.asarray(colour.difference.delta_E_CIE2000(lab[0], lab[1]), np.float64)

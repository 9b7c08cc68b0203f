"""Layers of cloth that lie on one another, by adding: [Kubelka1954] with one number a direction.

Light that has passed a layer is taken to be diffuse, so that each layer below needs but its
reflectance and transmittance in diffuse light.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def opaque(shares: Floats) -> Floats:
    """(...) reflectance at the view of so many layers that no light comes through.

    shares : (2, 2, ...) of `Layer.of`
    """
    (r_view, t_view), (r, t) = shares
    b = 1.0 + r**2 - t**2
    # The stable root of r x^2 - b x + r = 0: one more layer changes nothing.
    below = 2.0 * r / (b + np.sqrt(np.maximum(b * b - 4.0 * r * r, 0.0)))
    return np.asarray(r_view + t_view * t * below / (1.0 - r * below))


def single(shares: Floats) -> Floats:
    """(...) reflectance at the view of one layer over black."""
    return np.asarray(shares[0, 0])


BASIS = {"opaque": opaque, "singleLayer": single}
"""Basis of a target colour -> the reflectance that it is the colour of."""

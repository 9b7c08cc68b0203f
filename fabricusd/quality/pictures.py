"""Differences between two pictures of the same size, in linear Rec. 709.

RMSE          root of the mean squared difference, over pixels and channels
relative MSE  mean of (a - b)^2 / (b^2 + 0.01), b the reference: dark and bright pixels count alike
FLIP          [Andersson2020], the difference seen by flipping between the two, 0 to 1
delta E 2000  [Sharma2005], of the display colours, mean and 95th percentile
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.quality.colors import delta_e_2000

Picture = NDArray[np.float32]

RELATIVE_FLOOR = 0.01
"""Added to the squared reference, so that black pixels do not divide by zero."""


@dataclass(frozen=True)
class Difference:
    """Differences of a picture from its reference.

    not_finite : pixels that are NaN or infinity in either; the other figures leave them out
    """

    rmse: float
    relative_mse: float
    flip: float
    delta_e_mean: float
    delta_e_95: float
    not_finite: int


def flip_map(picture: Picture, reference: Picture, *, high_range: bool) -> NDArray[np.float64]:
    """(h, w) FLIP of two (h, w, 3) linear pictures, 0 to 1.

    high_range : True for radiance, which is compared at several exposures; False for display light
        from 0 to 1
    """
    import flip_evaluator

    # With inputsRGB=False, FLIP takes linear light. Negative values count as 0.
    error, _, _ = flip_evaluator.evaluate(
        np.ascontiguousarray(np.maximum(reference, 0.0), np.float32),
        np.ascontiguousarray(np.maximum(picture, 0.0), np.float32),
        "HDR" if high_range else "LDR",
        inputsRGB=False,
        applyMagma=False,
    )
    return np.asarray(error, np.float64).reshape(reference.shape[:2])


def difference(picture: Picture, reference: Picture, *, high_range: bool = True) -> Difference:
    """Every figure for (h, w, 3) `picture` against `reference`, both linear.

    Raises FabricError if the sizes differ, or if no pixel is finite in both.
    """
    if picture.shape != reference.shape or picture.ndim != 3 or picture.shape[2] != 3:
        raise FabricError(
            "pictures", f"are {_size(picture)} and {_size(reference)}; they must have the same size"
        )
    good = np.asarray(np.isfinite(picture).all(axis=2) & np.isfinite(reference).all(axis=2))
    if not good.any():
        raise FabricError("pictures", "have no pixel that is finite in both")
    a = np.asarray(picture, np.float64)[good]
    b = np.asarray(reference, np.float64)[good]
    square = (a - b) ** 2
    colors = delta_e_2000(picture[good][None], reference[good][None])
    # FLIP looks at neighbourhoods, so pixels that are not finite are made equal in both.
    flip = flip_map(
        np.where(good[..., None], picture, 0.0).astype(np.float32),
        np.where(good[..., None], reference, 0.0).astype(np.float32),
        high_range=high_range,
    )
    return Difference(
        rmse=float(np.sqrt(square.mean())),
        relative_mse=float((square / (b * b + RELATIVE_FLOOR)).mean()),
        flip=float(flip[good].mean()),
        delta_e_mean=float(colors.mean()),
        delta_e_95=float(np.quantile(colors, 0.95)),
        not_finite=int(np.count_nonzero(~good)),
    )


def _size(picture: Picture) -> str:
    return " x ".join(str(n) for n in picture.shape)


def heat(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """(h, w) values from 0 to 1 -> (h, w, 3) uint8, black through red and yellow to white."""
    x = np.clip(values, 0.0, 1.0)[..., None] * 3.0 - np.arange(3.0)
    return np.asarray(np.rint(np.clip(x, 0.0, 1.0) * 255), np.uint8)

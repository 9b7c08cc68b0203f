"""The shadowing methods by name and number, and the tables that they need."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

METHODS = ("none", "peak", "horizon", "traced")
NONE, PEAK, HORIZON, TRACED = range(4)


class Shadow(NamedTuple):
    """The tables that a shadowing method needs in addition to the compiled fabric.

    method : int - NONE, PEAK, HORIZON or TRACED
    highest : real - greatest height of the field [m]
    softness : real - width of the shadow's edge in the light's elevation [rad]; of its mean only
        for `traced`
    crest_first, crest_last : (k, q) real - intervals of each type's run that are as high as its
        peak; an interval is empty if its last position is less than its first
    crest_height : (k,) real - height there, in run lengths
    table, kinds : of `horizon.Horizon`; a single zero and (0, 0) for the other methods
    texels : uint16, flat - each entry of the table, and 256 times that in the next row
    mean : (stretches, columns + 1, GROUPS) real, flat - `mean.groups_of`, horizons in softnesses;
        one entry for `none`
    mean_bounds : (stretches, mean.SECTORS) int32, flat - by sector of the light's azimuth, the
        elevation below which light reaches no place of a stretch, and 65536 times the one from
        which on it reaches all, in 1/mean.ELEVATION; of `horizon` alone
    mean_columns, groups : int - its azimuths; GROUPS
    set_stretches, piece_first, piece_last, piece_scale : see `mean.Stretches`
    absolute : (k,) uint8 - whether threads of the type follow a law with an absolute shadow
    all_absolute : int - whether all do
    """

    method: int
    highest: Any
    softness: Any
    crest_first: NDArray[Any]
    crest_last: NDArray[Any]
    crest_height: NDArray[Any]
    table: NDArray[np.uint8]
    kinds: NDArray[np.int32]
    texels: NDArray[np.uint16]
    mean: NDArray[Any]
    mean_bounds: NDArray[np.int32]
    mean_columns: int
    groups: int
    set_stretches: int
    piece_first: NDArray[np.int32]
    piece_last: NDArray[np.int32]
    piece_scale: NDArray[Any]
    absolute: NDArray[np.uint8]
    all_absolute: int

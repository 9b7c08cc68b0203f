"""Load the cached kernels of a picture in a third of the time that numba takes by itself."""

from __future__ import annotations

from functools import lru_cache

from fabricusd.appearance.fuzz import fuzz_over_all
from fabricusd.appearance.shadow.methods import lit_all
from fabricusd.appearance.surface import conserving_all, far_all, points_all
from fabricusd.appearance.weave.lookup import crests_all, find_all, heights_all
from fabricusd.kernels.start import load_as_they_are, load_without_blas
from fabricusd.preview.kernels.raster import frames, rasterise, reached
from fabricusd.preview.kernels.sky import sky_light

KERNELS = (
    rasterise, frames, reached, sky_light, far_all, points_all, conserving_all, lit_all,
    fuzz_over_all, find_all, crests_all, heights_all,
)  # fmt: skip


@lru_cache(maxsize=1)
def start() -> None:
    """Make ready what numba does before it loads a kernel; once per process."""
    load_without_blas()
    load_as_they_are(KERNELS)

"""Build the sampler of published cloth: pass the law's values to the fit of the lobe shares."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from fabricusd.appearance.laws import law_of
from fabricusd.appearance.published.far import far_values
from fabricusd.appearance.published.levels import point_value
from fabricusd.appearance.published.tables import SurfaceTables
from fabricusd.appearance.sampling.fit import Singles, fitted_mixture
from fabricusd.appearance.sampling.mixture import Mixture
from fabricusd.appearance.sampling.stretches import OF_SET, OF_THREAD, PSI0
from fabricusd.appearance.weave.place import Place
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import KERNEL

EVEN_SHARE = 0.15
"""Share of directions that are uniform over the hemisphere."""

LEAST_SHARE = 0.1
"""See `share_fit.best_shares`. At grazing views there are narrow bright regions that a few
directions per lobe miss; without this share, the variance on satin doubles."""


def published_mixture(fabric: Fabric, tables: SurfaceTables) -> Mixture:
    """Lobes above the cloth only, with shares measured on `tables`."""
    single: Any = np.float32
    kept = _in_single_precision(fabric, tables)

    def far(wi: Singles, wo: Singles, out: Singles) -> None:
        far_values(single, kept, wi, wo, out, 0, wi.shape[1])

    def at_point(stretch: Singles, wi: Singles, wo: Singles, out: Singles) -> None:
        _point_values(single, kept, stretch, wi, wo, out)

    return fitted_mixture(
        fabric, tables.threads, even=EVEN_SHARE, least=LEAST_SHARE,
        sides=1, opaque=True, cosines=False,
        far=far, at_point=at_point,
    )  # fmt: skip


def _in_single_precision(fabric: Fabric, tables: SurfaceTables) -> SurfaceTables:
    """The tables in float32, which suffices for the shares; one kernel then serves all
    precisions."""
    return tables._replace(
        threads=tables.threads.astype(np.float32),
        nodes=tables.nodes.astype(np.float32),
        gap=np.float32(tables.gap),
        **law_of(fabric).make(fabric, None, None, np.float32),
    )


@njit(**KERNEL)
def _point_values(R, tables, stretch, wi, wo, out):
    """`point_value` at level `weave` of all pairs on a stretch: wi, wo, out are (3, n)."""
    for k in range(wi.shape[1]):
        place = Place(int(stretch[OF_SET]), int(stretch[OF_THREAD]), stretch[PSI0], R(0), R(1))
        out[0, k], out[1, k], out[2, k] = point_value(
            R, tables, False, place, wi[0, k], wi[1, k], wi[2, k], wo[0, k], wo[1, k], wo[2, k]
        )

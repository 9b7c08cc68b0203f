"""Build the sampler of conserving cloth: pass the law's values to the fit of the lobe shares."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.cloth_key import cloth_key
from fabricusd.appearance.conserving.blocks import conserving_far_values
from fabricusd.appearance.conserving.multiple import conserving_point_value
from fabricusd.appearance.conserving.single import ConservingTables
from fabricusd.appearance.sampling.fit import Singles, fitted_mixture
from fabricusd.appearance.sampling.mixture import Mixture, count_lobes
from fabricusd.appearance.sampling.stretches import OF_SET, OF_THREAD, PSI0, stretches_of
from fabricusd.appearance.weave.place import Place
from fabricusd.cache import kept
from fabricusd.fabric import Fabric
from fabricusd.kernels.cache import fingerprint
from fabricusd.kernels.real import KERNEL

EVEN_SHARE = 0.1
"""Share of uniform directions. It is smaller than for published cloth because, without `1/Q`, there
are no narrow bright regions that the lobes miss."""

LEAST_SHARE = 0.02
"""See `share_fit.best_shares`."""


def conserving_mixture(fabric: Fabric, tables: ConservingTables) -> Mixture:
    """Lobes on both sides, or on one side of opaque cloth, with shares measured on `tables`.

    The shares take a second to measure; the cache keeps them.
    """
    single: Any = np.float32
    held = _in_single_precision(tables)

    def far(wi: Singles, wo: Singles, out: Singles) -> None:
        conserving_far_values(single, held, wi, wo, out, 0, wi.shape[1])

    def at_point(stretch: Singles, wi: Singles, wo: Singles, out: Singles) -> None:
        _point_values(single, held, stretch, wi, wo, out)

    def made() -> NDArray[np.float32]:
        found = fitted_mixture(
            fabric, tables.threads, even=EVEN_SHARE, least=LEAST_SHARE, sides=2,
            opaque=bool(tables.opaque), cosines=True, far=far, at_point=at_point,
        )  # fmt: skip
        both = np.concatenate((found.shares, found.point_shares), axis=-1)
        return both.astype(np.float32)

    rows = stretches_of(fabric)
    R = tables.threads.dtype.type
    lobes = count_lobes(len(rows), 2, 1)
    shares = kept("shares", (fingerprint(), held.nodes, held.sides, *cloth_key(fabric)), made)
    return Mixture(
        rows.astype(R), np.ascontiguousarray(shares[..., :lobes], R),
        np.ascontiguousarray(shares[..., lobes:], R), R(EVEN_SHARE), 2, int(tables.opaque), 1,
    )  # fmt: skip


def _in_single_precision(tables: ConservingTables) -> ConservingTables:
    """The tables in float32, which suffices for the shares: one kernel serves both precisions."""
    return tables._replace(
        threads=tables.threads.astype(np.float32),
        nodes=tables.nodes.astype(np.float32),
        covered=np.float32(tables.covered),
        sides=tables.sides.astype(np.float32),
        gap=tables.gap.astype(np.float32),
        strength=tables.strength.astype(np.float32),
    )


@njit(**KERNEL)
def _point_values(R, tables, stretch, wi, wo, out):
    """`conserving_point_value` of all pairs on a stretch: wi, wo, out are (3, n)."""
    for k in range(wi.shape[1]):
        place = Place(int(stretch[OF_SET]), int(stretch[OF_THREAD]), stretch[PSI0], R(0), R(1))
        out[0, k], out[1, k], out[2, k] = conserving_point_value(
            R, tables, place, wi[0, k], wi[1, k], wi[2, k], wo[0, k], wo[1, k], wo[2, k]
        )

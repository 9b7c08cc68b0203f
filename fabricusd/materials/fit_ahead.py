"""Fits of a look on the workers of a cluster: the cache knows them when the look is written.

A worker fits as this machine would, and sends what its cache has got by it. Here nothing is left to
fit, and a worker's loss costs nothing but time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from numpy.typing import NDArray

from fabricusd.cache import Unknown, keep, only_known, recorded
from fabricusd.fabric import Fabric
from fabricusd.materials.fit.keep import fit_lay
from fabricusd.materials.fit.target import TexelSample
from fabricusd.materials.lobes.known import mixture_of
from fabricusd.materials.lobes.mixture import CYCLES, MATERIALX
from fabricusd.materials.near.keep import near_of
from fabricusd.run.cluster import Cluster
from fabricusd.run.spread import spread

KINDS = ("fits", "lobes", "near")
"""Kinds of what the cache keeps of fits."""

Entries = list[tuple[str, str, NDArray[Any]]]


class Surfaces(NamedTuple):
    """Fits of surfaces to a lay's texels; see `fit.keep.fit_lay`."""

    texels: TexelSample
    fabric: Fabric
    kinds: tuple[str, ...]

    def fit(self) -> None:
        """Fit, or find the fits in the cache."""
        fit_lay(self.texels, self.fabric, self.kinds, waiting=lambda _: _nobody)


class Lobes(NamedTuple):
    """Fits of so many lobes to a fabric, in both forms; near : whether to its threads, too"""

    fabric: Fabric
    lobes: int
    max_error: float | None
    near: bool

    def fit(self) -> None:
        """Fit, or find the fits in the cache."""
        for form in (CYCLES, MATERIALX):
            found = mixture_of(self.fabric, self.lobes, form, max_error=self.max_error)
            if self.near:
                near_of(self.fabric, found)


def fit_ahead(
    jobs: Sequence[Surfaces | Lobes], cluster: Cluster, progress: Callable[[str], None] | None
) -> None:
    """Let the cluster fit what the cache does not know yet, and keep it."""
    wanted = [job for job in jobs if not _known(job)]
    if not wanted:
        return
    if progress:
        progress(f"fitting on the cluster: {len(wanted)} jobs")
    for entries in spread("fits", _fitted, None, wanted, cluster):
        for kind, name, array in entries:
            keep(kind, name, array)


def _known(job: Surfaces | Lobes) -> bool:
    try:
        with only_known(*KINDS):
            job.fit()
    except Unknown:
        return False
    return True


def _fitted(_: None, job: Surfaces | Lobes) -> Entries:
    with recorded(*KINDS) as entries:
        job.fit()
    return entries


def _nobody() -> None:
    """Is told of a fit that has to be waited for."""

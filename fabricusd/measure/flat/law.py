"""What cloth of two threads sends from lamp to camera, split into what is linear in their colours.

Of the `conserving` law at level `far`, with `alpha` the mean albedo of the threads,

    f = S + A_warp V_warp + A_weft V_weft + L C(alpha),  C = alpha^2 p / (1 - alpha (1 - p)).

The four columns and p depend on shape and lobes alone. What leaves by side (`appearance.conserving.
multiple`) takes seconds to balance and changes slowly, so that the tables of one cloth serve its
neighbours in a search, which then runs again with tables of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fabricusd.appearance.conserving.grid import mean_share, without_border
from fabricusd.appearance.conserving.multiple import conserving_tables, mean_albedo
from fabricusd.appearance.conserving.single import LOST, ConservingTables, single_tables
from fabricusd.appearance.levels import FAR, WEAVE
from fabricusd.appearance.scattering.columns import LAW
from fabricusd.appearance.scattering.model import CONSERVING
from fabricusd.appearance.shadow.methods import compile_shadow, lit_all
from fabricusd.appearance.surface import conserving_all, places_of
from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.fabric import Fabric

Floats = NDArray[np.float64]

NAMES = ("Warp", "Weft")


class Columns(NamedTuple):
    """Parts of the radiance per unit `L_i dwi`, each (n,) but the first two.

    surface, volume : (2, n) of the warp and of the weft, the latter per unit of albedo
    rest : light that bounces between threads, per unit of C
    """

    surface: Floats
    volume: Floats
    rest: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Balance:
    """What `conserving_tables` finds for a cloth: its tables by side, and the escape p."""

    tables: ConservingTables
    escape: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Shades:
    """How albedos become alpha: `alpha = base + share . A`, base a number, share (2,)."""

    base: float
    share: Floats
    escape: float

    def strength(self, albedo: Floats) -> Floats:
        """(...) C for albedos (2, ...)."""
        alpha = self.base + np.tensordot(self.share, albedo, axes=1)
        p = self.escape
        return np.asarray(alpha**2 * p / (1.0 - alpha * (1.0 - p)))


def white_pair(fabric: Fabric, warp: Sequence[float], weft: Sequence[float]) -> Fabric:
    """`fabric` with other albedos of its threads "Warp" and "Weft"."""
    threads = {
        name: replace(fabric.threads[name], albedo=(albedo[0], albedo[1], albedo[2]))
        for name, albedo in zip(NAMES, (warp, weft), strict=True)
    }
    return replace(fabric, threads=threads)


def balance(fabric: Fabric) -> Balance:
    """The tables by side of a cloth; takes seconds."""
    tables = conserving_tables(white_pair(fabric, (1, 1, 1), (1, 1, 1)))
    covered = 1.0 - tables.gap
    sides = without_border(tables.sides)
    lost = sum(mean_share(sides[side, :, :, LOST]) for side in range(2))
    return Balance(tables=tables, escape=1.0 - lost / max(mean_share(covered), 1e-300))


def columns(fabric: Fabric, known: Balance, pairs: tuple[Floats, Floats]) -> Columns:
    """The columns of a cloth near the one that `known` was found for.

    pairs : (n, 3) to the lamp, (n, 3) to the camera, in the cloth's frame
    """
    # Red tells the surface alone; green adds the volume.
    probe = single_tables(white_pair(fabric, (0, 1, 0), (0, 1, 0)))
    probe = probe._replace(sides=known.tables.sides, gap=known.tables.gap)
    wi, wo = (np.ascontiguousarray(w.T) for w in pairs)
    warp = np.arange(len(probe.node_thread)) >= probe.warp_start
    scatters = probe.scatters
    found = []
    for which in (warp, ~warp):
        only = probe._replace(scatters=(scatters * which).astype(np.uint8))
        found.append(_evaluated(fabric, only, wi, wo))
    none = probe._replace(
        scatters=np.zeros_like(scatters),
        strength=np.tile(known.tables.strength[:, :1], (1, 3)),
    )
    rest = _evaluated(fabric, none, wi, wo)[0]
    return Columns(
        surface=np.stack([f[0] for f in found]),
        volume=np.stack([f[1] - f[0] for f in found]),
        rest=rest,
    )


def shades(fabric: Fabric, escape: float) -> Shades:
    """How the albedos of `fabric` make its mean albedo."""
    dark, warp, weft = (
        float(mean_albedo(white_pair(fabric, (a,) * 3, (b,) * 3))[0])
        for a, b in ((0, 0), (1, 0), (0, 1))
    )
    return Shades(base=dark, share=np.array([warp - dark, weft - dark]), escape=escape)


def areas(fabric: Fabric) -> Floats:
    """(2,) shares of the cloth that warp and weft cover."""
    area = coverage(fabric).type_area.sum(axis=1)
    return np.array([float(area[1]), float(area[0])])


def _evaluated(fabric: Fabric, tables: ConservingTables, wi: Floats, wo: Floats) -> Floats:
    real: Any = np.float64
    out = np.zeros_like(wi)
    conserving_all(real, tables, FAR, places_of(fabric, np.zeros((1, 2))).places, wi, wo, out)
    return out


def radiance(part: Columns, albedo: Floats, shade: Shades) -> Floats:
    """(n, 3) radiance per unit `L_i dwi` for albedos (2, 3)."""
    return np.asarray(
        part.surface.sum(axis=0)[:, None]
        + part.volume.T @ albedo
        + part.rest[:, None] * shade.strength(albedo)
    )


class Patch(NamedTuple):
    """A few pixels of the cloth in the middle of a picture, as `Columns`, each (k, k).

    surface, rest : as in `Columns`; warp, weft : volume where each set is on top
    """

    surface: Floats
    warp: Floats
    weft: Floats
    rest: Floats


PATCH = 36
"""Pixels of a patch per side."""
FINE = 3
"""Places per pixel and side."""
BLUR = 0.41
"""Standard deviation of the renderer's tent filter [pixels]."""


def patch(
    fabric: Fabric, known: Balance, pair: tuple[Floats, Floats], frequencies: Floats
) -> Patch:
    """What pixels of the cloth show, level `weave` with shadows, under one pair of directions.

    frequencies : (2, 2) as in `Lattice`, threads per pixel
    """
    at = (np.arange(PATCH * FINE) + 0.5) / FINE
    x, y = np.meshgrid(at, at)
    uv = np.stack((x.ravel(), y.ravel()), axis=1) @ frequencies
    probe = single_tables(white_pair(fabric, (0, 1, 0), (0, 0, 1)))
    probe = probe._replace(sides=known.tables.sides, gap=known.tables.gap)
    hit = places_of(fabric, uv)
    wi, wo = (np.ascontiguousarray(np.repeat(w[:, None], len(uv), 1)) for w in pair)
    real: Any = np.float64
    found = np.zeros((2, 3, len(uv)))
    conserving_all(real, probe, WEAVE, hit.places, wi, wo, found[0])
    none = probe._replace(
        scatters=np.zeros_like(probe.scatters), threads=_dark(probe.threads),
        strength=np.tile(known.tables.strength[:, :1], (1, 3)),
    )  # fmt: skip
    conserving_all(real, none, WEAVE, hit.places, wi, wo, found[1])
    lit = np.empty(len(uv))
    cloth = compile_fabric(fabric, precision=np.float64)
    lit_all(real, cloth, compile_shadow(fabric, "horizon", precision=np.float64), True,
            np.ascontiguousarray(hit.even_uv), wi, lit)  # fmt: skip
    found *= lit

    def pixels(values: Floats) -> Floats:
        smooth = gaussian_filter(
            values.reshape(PATCH * FINE, PATCH * FINE), BLUR * FINE, mode="wrap"
        )
        return np.asarray(smooth.reshape(PATCH, FINE, PATCH, FINE).mean(axis=(1, 3)))

    once, rest = found
    return Patch(
        surface=pixels(once[0]), warp=pixels(once[1] - once[0]), weft=pixels(once[2] - once[0]),
        rest=pixels(rest[0]),
    )  # fmt: skip


def _dark(threads: Floats) -> Floats:
    """Rows of threads of no model that scatters once."""
    changed = threads.copy()
    changed[:, LAW] = CONSERVING + 1
    return changed


def patch_radiance(part: Patch, albedo: Floats, shade: Shades) -> Floats:
    """(k, k, 3) radiance of a patch for albedos (2, 3)."""
    return np.asarray(
        part.surface[..., None]
        + part.warp[..., None] * albedo[0]
        + part.weft[..., None] * albedo[1]
        + part.rest[..., None] * shade.strength(albedo)
    )

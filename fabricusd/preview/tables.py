"""The tables of a fabric that pictures are shaded from, kept in the cache as one archive.

The path tracer makes the same tables, and samplers besides; making them takes from a tenth of a
second to several, reading them a hundredth.
"""

from __future__ import annotations

import hashlib
import math
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.conserving.multiple import conserving_tables
from fabricusd.appearance.conserving.single import ConservingTables
from fabricusd.appearance.fuzz import Fuzz
from fabricusd.appearance.law import CONSERVING_ONLY, MIXED, PUBLISHED_ONLY
from fabricusd.appearance.laws import law_of
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.scattering.models import any_conserving, any_published
from fabricusd.appearance.shadow.kinds import Shadow
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.surface import fuzz_of
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.yarn.compiled import Yarn, compile_yarn
from fabricusd.cache import kept_groups
from fabricusd.fabric import Fabric, one_side
from fabricusd.kernels.cache import fingerprint
from fabricusd.preview.kernels.sky import COLUMNS, ROWS
from fabricusd.preview.values import value_far

REAL: Any = np.float32

RINGS, AROUND = 32, 96
"""Directions of the sky: Gauss-Legendre points in the sine of the elevation, and azimuths."""

LOWEST = 0.01
"""Sine of the lowest view in the table of the sky: at 0 a law need not be defined."""


class Tables(NamedTuple):
    """All tables of one side of a cloth, in float32.

    kind : PUBLISHED_ONLY, CONSERVING_ONLY or MIXED
    published : of `published.tables`; conserving : None for PUBLISHED_ONLY
    yarn : None where threads are even; fuzz : None where none is hairy
    sky : see `kernels.sky.sky_light`
    """

    kind: int
    published: Any
    conserving: ConservingTables | None
    cloth: CompiledFabric
    shadow: Shadow
    yarn: Yarn | None
    fuzz: Fuzz | None
    sky: NDArray[np.float32]


_GROUPS: dict[str, Any] = {
    "conserving": ConservingTables, "cloth": CompiledFabric, "shadow": Shadow, "yarn": Yarn,
    "fuzz": Fuzz,
}  # fmt: skip


@lru_cache(maxsize=64)
def tables_of(fabric: Fabric) -> Tables:
    """The tables of `fabric`, from the cache if they were made before."""
    key = (fingerprint(), _sources(), *one_side(fabric))
    kinds = {"published": law_of(fabric).tables, **_GROUPS}
    return Tables(**kept_groups("preview", key, lambda: _made(fabric)._asdict(), kinds))


def _made(fabric: Fabric) -> Tables:
    kind = PUBLISHED_ONLY
    if any_conserving(fabric):
        kind = MIXED if any_published(fabric) else CONSERVING_ONLY
    shadow = compile_shadow(fabric, "horizon", precision=REAL)
    held = shadow if law_of(fabric).absolute else None
    made = Tables(
        kind=kind,
        published=surface_tables(fabric, precision=REAL, shadow=held),
        conserving=None if kind == PUBLISHED_ONLY else conserving_tables(fabric, precision=REAL),
        cloth=compile_fabric(fabric, precision=REAL),
        shadow=shadow,
        yarn=compile_yarn(fabric, precision=REAL) if fabric.is_uneven else None,
        fuzz=fuzz_of(fabric, REAL),
        sky=np.zeros((ROWS, COLUMNS + 1, 4, 3), REAL),
    )
    return made._replace(sky=_sky_table(made))


def _sky_table(tables: Tables) -> NDArray[np.float32]:
    """`Tables.sky`: integrals over the half of the sky above the cloth."""
    sky, weight = _sky_directions()
    moments = np.concatenate((weight[:, None], weight[:, None] * sky), axis=1)
    wi = np.ascontiguousarray(sky.T, REAL)
    found = np.zeros((ROWS, COLUMNS + 1, 4, 3), REAL)
    for row in range(ROWS):
        z = max(1.0 - (row / (ROWS - 1)) ** 2, LOWEST)
        views = np.array([_view(4.0 * column / COLUMNS, z) for column in range(COLUMNS)])
        # One row of views at a time keeps the arrays small.
        wo = np.ascontiguousarray(np.repeat(views, len(sky), axis=0).T, REAL)
        out = value_far(tables, np.tile(wi, (1, COLUMNS)), wo)
        found[row, :-1] = np.einsum("cvn,nm->vmc", out.reshape(3, COLUMNS, -1), moments)
    found[:, -1] = found[:, 0]
    return found


def _sky_directions() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n, 3) directions above the cloth and (n,) their solid angles; each ring is turned."""
    z, ring = np.polynomial.legendre.leggauss(RINGS)
    z, ring = 0.5 * (z + 1.0), 0.5 * ring
    start = (np.arange(RINGS) * 0.6180339887498949) % 1.0
    turn = (np.arange(AROUND) + start[:, None]) * (2 * math.pi / AROUND)
    flat = np.sqrt(1.0 - z * z)[:, None]
    sky = np.stack(
        (flat * np.cos(turn), flat * np.sin(turn), np.broadcast_to(z[:, None], turn.shape)), axis=-1
    )
    return sky.reshape(-1, 3), np.repeat(ring, AROUND) * (2 * math.pi / AROUND)


def _view(turn: float, z: float) -> tuple[float, float, float]:
    """The view of a diamond angle in [0, 4) and the cosine z."""
    quadrant, f = divmod(turn, 1.0)
    x, y = 1.0 - f, f
    for _ in range(int(quadrant)):
        x, y = -y, x
    flat = math.sqrt(1.0 - z * z) / math.hypot(x, y)
    return flat * x, flat * y, z


@lru_cache(maxsize=1)
def _sources() -> str:
    """Digest of the sources that say what a table holds, beside those of kernels."""
    digest = hashlib.blake2b(digest_size=10)
    for name in ("tables.py", "values.py"):
        digest.update((Path(__file__).parent / name).read_bytes())
    return digest.hexdigest()

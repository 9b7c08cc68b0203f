"""Load a bake and re-light its textures under any pair of light and view directions.

Each thread set of a texel is re-lit from the share of the texel that it covers, its `A`, and the
mean and standard deviation of its tangent angle. The angles are distributed about the mean as they
are in the fabric. A fine mip level therefore reproduces appearance level `weave`, and the coarsest
one level `far`.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from fabricusd.appearance import laws
from fabricusd.appearance.published.blocks import NOTHING
from fabricusd.appearance.published.far import normalization
from fabricusd.appearance.published.segment import along_set, segment
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.scattering.columns import GAMMA_SURFACE, MODEL
from fabricusd.appearance.scattering.models import any_conserving
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.appearance.weave.lookup import NO_THREAD
from fabricusd.bake.error.relight_law import relight_law
from fabricusd.bake.manifest_file import file_in, read_manifest
from fabricusd.bake.texels.angle_shape import COUNTS, angle_shapes
from fabricusd.bake.texels.encoding import Encoding
from fabricusd.bake.texels.moment_indices import PARTS
from fabricusd.errors import FabricError, reads
from fabricusd.fabric import Fabric
from fabricusd.images.files import read_mip_level
from fabricusd.kernels.real import KERNEL

Floats = NDArray[np.float64]

PER_SET = (("thread", "lean"), ("thread", "share", "angle"), ("thread", "share", "angle", "spread"))
"""Maps of each thread set that suffice to re-light it, cheapest choice first. Without the shares of
its parts a set has one mean angle and one spread; without spreads a part has one angle."""

RELIT = tuple(
    ("thread_id", *(f"{noun}_{what}" for noun in ("weft", "warp") for what in per_set))
    for per_set in PER_SET
)
"""Maps to re-light from, cheapest choice first."""

NEEDED = RELIT[-1]
"""The most accurate choice."""


@dataclass(frozen=True, eq=False)
class BakedSet:
    """A folder of baked textures, read by its manifest."""

    folder: Path
    manifest: dict[str, Any]

    @classmethod
    @reads("a bake")
    def load(cls, folder: str | Path) -> BakedSet:
        """Read the manifest of `folder`; raise FabricError if it is missing or invalid."""
        return cls(Path(folder), read_manifest(Path(folder)))

    def read(self, garment: str, name: str, level: int = 0, tile: int = 1001) -> NDArray[Any]:
        """(h, w, c) float32 pixels of one level of a map."""
        files = self.manifest["garments"].get(garment, {}).get("files", {})
        if str(tile) not in files.get(name, {}):
            raise FabricError(
                str(self.folder),
                f"has no map '{name}' of '{garment}' in tile {tile}; it must be one of "
                f"{', '.join(files) or 'none'}",
            )
        said = files[name][str(tile)]
        stored = read_mip_level(file_in(self.folder, said["file"]), level)
        stored = stored[..., : len(self.manifest["maps"][name]["channels"])]
        return Encoding(**said["encoding"]).decoded(stored) if "encoding" in said else stored

    def relight(
        self,
        garment: str,
        fabrics: Sequence[Fabric],
        wi: ArrayLike,
        wo: ArrayLike,
        *,
        level: int = 0,
        tile: int = 1001,
    ) -> Floats:
        """(h, w, 3) radiance per unit `L_i dwi` towards wo, black outside the UV layout.

        fabrics : of each lay, in the order of the manifest
        wi, wo : (3,) unit vectors in UV axes: x along u, y along v, z out of the cloth
        """
        known = self.manifest["garments"]
        if garment not in known:
            raise FabricError(
                str(self.folder),
                f"has no garment '{garment}'; it must be one of {', '.join(known)}",
            )
        maps = {
            name: self.read(garment, name, level, tile)
            for name in best_choice(self.manifest["garments"][garment]["files"])
        }
        lay = self.read(garment, "lay", level, tile)[..., 0]
        out = np.zeros((*lay.shape, 3))
        for k, (fabric, said) in enumerate(
            zip(fabrics, self.manifest["garments"][garment]["lays"], strict=True)
        ):
            mine = lay == k
            columns = np.linalg.inv(np.array(said["threads_per_uv"]))
            along = columns / np.linalg.norm(columns, axis=0)
            turned = [
                np.array([*(along.T @ np.asarray(w, np.float64)[:2]), np.asarray(w)[2]])
                for w in (wi, wo)
            ]
            out[mine] = relight({n: a[mine] for n, a in maps.items()}, fabric, *turned)
        return out


def relight(
    maps: Mapping[str, NDArray[Any]], fabric: Fabric, wi: ArrayLike, wo: ArrayLike
) -> Floats:
    """(n, 3) radiance per unit `L_i dwi` of texels.

    maps : (n, channels) by name, one of the choices in RELIT
    wi, wo : (3,) unit vectors in the weave's frame, x along U, y along V. Cloth with `conserving`
        threads may also be lit from below.
    """
    types = len(fabric.threads)
    area = coverage(fabric).type_area
    share = area / np.maximum(area.sum(axis=1, keepdims=True), 1e-30)
    ids = np.asarray(maps["thread_id"][:, 0])
    sets = np.stack([_set_of(maps, noun) for noun in ("weft", "warp")], axis=1)
    shapes = angle_shapes(fabric)
    if "weft_share" not in maps:
        # The single part is the whole set.
        shapes = np.repeat(shapes[:, PARTS:], PARTS + 1, axis=1)
    # Earlier versions stored 255 for texels without a thread.
    kinds = np.where((ids >= 0) & (ids < 2 * types), ids, NO_THREAD).astype(np.int64)
    i, o = (np.asarray(w, np.float64) for w in (wi, wo))
    if any_conserving(fabric) or laws.law_of(fabric).absolute:
        return relight_law(fabric, share, shapes, sets, kinds, i, o)
    out = np.zeros((len(ids), 3))
    _relight(surface_tables(fabric), share, shapes, types, sets, kinds, i, o, out)
    return out


def best_choice(names: Collection[str]) -> tuple[str, ...]:
    """Return the most accurate choice in RELIT that these maps allow, or NEEDED if none does."""
    return next((c for c in reversed(RELIT) if set(c) <= set(names)), NEEDED)


def _set_of(maps: Mapping[str, NDArray[Any]], noun: str) -> Floats:
    """(n, 16) values of a thread set: `A` and share; shares, mean angles and deviations by part."""
    thread = maps[f"{noun}_thread"]
    found = np.zeros((len(thread), 4 + 3 * PARTS))
    found[:, :4] = thread
    if f"{noun}_share" not in maps:
        # The first part stands for the whole set.
        found[:, 4] = thread[:, 3]
        found[:, 4 + PARTS], found[:, 4 + 2 * PARTS] = maps[f"{noun}_lean"].T
        return found
    for k, what in enumerate(("share", "angle", "spread")):
        if f"{noun}_{what}" in maps:
            found[:, 4 + k * PARTS : 4 + (k + 1) * PARTS] = maps[f"{noun}_{what}"]
    return found


class _Angles(NamedTuple):
    """The distribution of tangent angles in one part of a thread set.

    mean, deviation : [rad]
    shape : angles of mean 0 and deviation 1 by count, see `angle_shapes`
    """

    mean: Any
    deviation: Any
    shape: Any


@njit(parallel=True, **KERNEL)
def _relight(  # type: ignore[no-untyped-def]
    tables, share, shapes, types, sets, kinds, wi, wo, out
):
    """Add the radiance of each texel to out (n, 3).

    sets : (n, 2, 16) `A` and share; shares, mean angles and deviations by part
    kinds : (n,) thread ids, -1 for none
    """
    R = np.float64
    q = normalization(R, tables, wi[0], wi[1], wi[2], wo[0], wo[1], wo[2])
    if wi[2] <= 0.0 or wo[2] <= 0.0 or q <= NOTHING:
        return
    for k in prange(out.shape[0]):
        for j in range(2):
            if sets[k, j, 3] <= 0.0:
                continue
            pair = along_set(R, tables, j, wi[0], wi[1], wi[2], wo[0], wo[1], wo[2])
            for kind in range(types):
                # If a thread lies under the texel's centre, it stands for its whole set.
                weight = share[j, kind]
                if kinds[k] >= 0 and kinds[k] // types == j:
                    weight = 1.0 if kinds[k] % types == kind else 0.0
                row = tables.threads[kind]
                for part in range(PARTS):
                    covered = weight * sets[k, j, 4 + part]
                    if covered <= 0.0:
                        continue
                    angles = _Angles(sets[k, j, 8 + part], sets[k, j, 12 + part], shapes[j, part])
                    surface, volume = _part_terms(R, tables, row, angles, pair)
                    for channel in range(3):
                        value = surface + volume * sets[k, j, channel]
                        out[k, channel] += covered / q * value


@njit(**KERNEL)
def _part_terms(R, tables, row, angles, pair):  # type: ignore[no-untyped-def]
    """Return the surface and volume terms of a thread, averaged over its tangent angles.

    angles : `_Angles`; pair : what `along_set` returns
    tables : of the surface law
    """
    fewest = 3.0 * math.sqrt(3.0) * angles.deviation / row[GAMMA_SURFACE]
    kind = 0
    while kind < len(COUNTS) - 1 and COUNTS[kind] < fewest:
        kind += 1
    nodes = COUNTS[kind]
    first, second = 0.0, 0.0
    for node in range(nodes):
        angle = angles.mean + angles.deviation * angles.shape[kind, node]
        angle = min(max(angle, -0.5 * math.pi), 0.5 * math.pi)
        c, s = math.cos(angle), math.sin(angle)
        surface, volume = segment(R, tables, int(row[MODEL]), row, c, s, pair)
        p = laws.weight(R, tables, c, s, pair) / nodes
        first += p * surface
        second += p * volume
    return first, second

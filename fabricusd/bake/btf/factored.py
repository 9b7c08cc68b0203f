"""Read and write the factored form: a table of one repeat that is indexed by weave coordinates.

The atlas holds the same factors as pictures, for tools that can only read textures.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fabricusd.bake.btf.archive import read_arrays
from fabricusd.bake.btf.damage import damage_in, require_whole
from fabricusd.bake.btf.factors import Factors
from fabricusd.bake.btf.interpolate import evaluate
from fabricusd.bake.btf.matrix import LARGEST, Btf
from fabricusd.errors import FabricError, reads
from fabricusd.files import whole_file
from fabricusd.images.files import read_exr_layers, write_exr

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class FactoredBtf:
    """Factors of one repeat; joint, except those read from `.btf` files with a set per channel.

    directions : (d, 3) unit vectors, of light and of view alike
    size : (h, w) texels
    per_thread : texels along a thread's pitch
    """

    directions: Floats
    factors: Factors
    size: tuple[int, int]
    per_thread: int

    def evaluate(self, weave: ArrayLike, wi: ArrayLike, wo: ArrayLike) -> Floats:
        """(n, 3) radiance per unit `L_i dwi` at weave coordinates (n, 2), cosine included.

        wi, wo : (3,) unit vectors in the weave's frame
        """
        return evaluate(self.directions, self.factors, self.size, self.per_thread, weave, wi, wo)


def factored(btf: Btf, made: Factors) -> FactoredBtf:
    """Combine a table and its joint factors."""
    return FactoredBtf(
        directions=btf.directions, factors=made, size=btf.size, per_thread=btf.per_thread
    )


def write_factored(path: str | os.PathLike[str], one: FactoredBtf) -> None:
    """Write a compressed `.npz` file of half floats atomically."""
    rows, columns = one.factors.rows[0], one.factors.columns[0]
    scale = np.maximum(np.abs(rows).max(axis=(0, 1)), 1e-20)
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(
            stream,
            directions=one.directions,
            rows=(rows / scale).astype(np.float16),
            columns=(columns * scale).astype(np.float16),
            size=np.array(one.size),
            per_thread=np.array(one.per_thread),
            delta_e=np.array(one.factors.delta_e),
        )


ARRAYS = {"directions": 2, "rows": 3, "columns": 2, "size": 1, "per_thread": 0, "delta_e": 0}
"""Number of axes of each array in the file."""

KIND = "a factored BTF"


@reads("a factored BTF")
def read_factored(path: str | os.PathLike[str]) -> FactoredBtf:
    """Read a file that `write_factored` wrote; raise FabricError for any other."""
    data = read_arrays(path, ARRAYS, KIND)
    where = str(path)
    if data["size"].shape != (2,) or data["size"].dtype.kind == "f":
        raise FabricError(where, f"has the size {data['size'].tolist()}; it must be two integers, "
                          "the height and width in texels")  # fmt: skip
    h, w = (int(n) for n in data["size"])
    with np.errstate(over="ignore"):  # overflows become infinite, which is reported below
        rows, columns = data["rows"].astype(np.float32), data["columns"].astype(np.float32)
    return _whole(
        where,
        directions=data["directions"].astype(np.float64),
        factors=Factors(rows=(rows,), columns=(columns,), delta_e=float(data["delta_e"])),
        size=(h, w),
        per_thread=float(data["per_thread"]),
    )


def _whole(
    where: str, *, directions: Floats, factors: Factors, size: tuple[int, int], per_thread: float
) -> FactoredBtf:
    """Check that the parts read from `where` are consistent, and combine them."""
    require_whole(where, directions, factors, size)
    if not (math.isfinite(factors.delta_e) and factors.delta_e >= 0):
        raise FabricError(where, f"has the error {factors.delta_e}; it must be at least 0")
    if not (1 <= per_thread <= LARGEST and per_thread == int(per_thread)):
        raise FabricError(
            where,
            f"has {per_thread:g} texels per thread; it must be an integer from 1 to {LARGEST}",
        )
    return FactoredBtf(
        directions=directions, factors=factors, size=size, per_thread=int(per_thread)
    )


def write_atlas(stem: str | os.PathLike[str], one: FactoredBtf) -> tuple[Path, Path]:
    """Write `<stem>.components.exr` and `<stem>.weights.exr`.

    Reflectance is the sum over k of component k at a position times weight k at a pair of
    directions. A component is a channel over one repeat, its top row at the largest v. A weight is
    an RGB layer with the index of the light along x and the index of the view along y.
    """
    d, (h, w) = len(one.directions), one.size
    columns = one.factors.columns[0].reshape(h, w, -1)[::-1]
    weights = one.factors.rows[0].reshape(d, d, 3, -1)
    names = [f"c{k:03d}" for k in range(columns.shape[2])]
    places, angles = Path(f"{stem}.components.exr"), Path(f"{stem}.weights.exr")
    said = {"fabricusd:texelsPerThread": one.per_thread, "fabricusd:deltaE": one.factors.delta_e}
    write_exr(
        places,
        {n: columns[..., k : k + 1] for k, n in enumerate(names)},
        dict.fromkeys(names, ("Y",)),
        said,
    )
    polar = ";".join(f"{x:.6f},{y:.6f},{z:.6f}" for x, y, z in one.directions)
    write_exr(
        angles,
        {n: weights[..., k] for k, n in enumerate(names)},
        dict.fromkeys(names, ("R", "G", "B")),
        {**said, "fabricusd:directions": polar},
    )
    return places, angles


@reads("an atlas of a BTF")
def read_atlas(stem: str | os.PathLike[str]) -> FactoredBtf:
    """Read files that `write_atlas` wrote; raise FabricError for any others."""
    places, said = read_exr_layers(Path(f"{stem}.components.exr"))
    angles, also = read_exr_layers(Path(f"{stem}.weights.exr"))
    where = f"{stem}.weights.exr"
    if sorted(places) != sorted(angles) or len({a.shape for a in angles.values()}) != 1:
        raise FabricError(
            where,
            f"has {len(angles)} layers beside {len(places)} components; it must have one RGB layer "
            "for each",
        )
    names = sorted(places)
    with damage_in(where, "an atlas of a BTF"):
        columns = np.concatenate([places[n][::-1] for n in names], axis=-1)
        rows = np.stack([angles[n] for n in names], axis=-1)
        written = str(also["fabricusd:directions"]).split(";")
        directions = np.array([tuple(map(float, p.split(","))) for p in written])
        delta_e = float(said["fabricusd:deltaE"])
        per_thread = float(said["fabricusd:texelsPerThread"])
        h, w, rank = columns.shape
        rows, columns = rows.reshape(-1, 3, rank), columns.reshape(h * w, rank)
    return _whole(
        where,
        directions=directions,
        factors=Factors(rows=(rows,), columns=(columns,), delta_e=delta_e),
        size=(h, w),
        per_thread=per_thread,
    )

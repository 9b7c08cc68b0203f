"""Read and write `.btf` files in the format of the University of Bonn's 2014 database.

A file holds full-matrix factorisations in half floats, one per channel (`DFMF`) or a joint one
(`FMF`). The layout follows the behaviour of independent readers: a header, the directions by view,
the size, and then for each matrix its rank, singular values, left vectors, and right vectors times
singular values. Rows of the picture run from the top in the readers and from the bottom in the
file.
"""

from __future__ import annotations

import math
import os
import struct
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.btf.damage import require_finite, require_whole
from fabricusd.bake.btf.factors import Factors
from fabricusd.bake.btf.matrix import Btf
from fabricusd.errors import FabricError, reads
from fabricusd.files import readable_file, whole_file

JOINT, PER_CHANNEL = b"!FMF06FC", b"!DFMF08FC"

_HEADER = struct.Struct("<II80s80s80s4f")
_VERSION = 1

_ONE, _TWO, _KIND = struct.Struct("<I"), struct.Struct("<II"), struct.Struct("<BI")

_HALF = 2
"""Code of half floats in the file."""


@dataclass(frozen=True, kw_only=True, eq=False)
class UboFile:
    """The contents of a file: directions (d, 3), size (h, w) and factors."""

    directions: NDArray[np.float64]
    size: tuple[int, int]
    factors: Factors


def write_ubo(path: str | os.PathLike[str], btf: Btf, made: Factors) -> None:
    """Write a table's factors atomically."""
    joint = len(made.rows) == 1
    angles = _angles(btf.directions)
    h, w = btf.size
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        stream.write(JOINT if joint else PER_CHANNEL)
        pitch = btf.fabric.warp.pitch * 1e3
        stream.write(
            _HEADER.pack(
                _HEADER.size, _VERSION, b"fabricusd", b"computed", b"directional",
                btf.per_thread / pitch, 1.0, 1.0, 1.0,
            )
        )  # fmt: skip
        stream.write(struct.pack("<I", len(angles)))
        for view in angles:
            stream.write(view.tobytes() + struct.pack("<I", len(angles)) + angles.tobytes())
        stream.write(struct.pack("<II", w, h))
        if joint:
            _write_joint(stream, made)
            return
        stream.write(struct.pack("<II", made.rank, 0))
        stream.write(np.zeros(3, "<f4").tobytes() + np.eye(3, dtype="<f4").tobytes())
        for rows, columns in zip(made.rows, made.columns, strict=True):
            u, c, norms = _halves(rows, columns)
            stream.write(struct.pack("<BI", 2, c.shape[1]))
            stream.write(struct.pack("<II", len(u), len(c)))
            stream.write(norms.tobytes() + u.tobytes() + c.tobytes())


def _write_joint(stream: BinaryIO, made: Factors) -> None:
    rows, columns = made.rows[0], made.columns[0]
    u, c, norms = _halves(rows, columns)
    rank = c.shape[1]
    stream.write(struct.pack("<IBI", rank, 2, rank))
    stream.write(struct.pack("<II", rows.shape[0] * rows.shape[1], len(c)))
    stream.write(norms.tobytes() + u.tobytes() + c.tobytes())


def _halves(
    rows: NDArray[np.float32], columns: NDArray[np.float32]
) -> tuple[NDArray[np.float16], NDArray[np.float16], NDArray[np.float16]]:
    """Convert factors and singular values to half floats, scaled so that neither side overflows."""
    size = np.maximum(np.abs(rows).max(axis=(0, 1)), 1e-20)
    norms = np.linalg.norm(columns, axis=0)
    u, c = (rows / size).astype("<f2"), (columns * size).astype("<f2")
    if not (np.isfinite(u).all() and np.isfinite(c).all()):
        raise FabricError("btf", f"has values up to {float(np.abs(columns * size).max()):.3g}; "
                          "they must be at most 65504, the largest half float")  # fmt: skip
    return u, c, norms.astype("<f2")


def _angles(directions: NDArray[np.float64]) -> NDArray[np.float32]:
    """(d, 2) inclination and azimuth [rad]."""
    x, y, z = directions.T
    return np.stack((np.arccos(np.clip(z, -1, 1)), np.arctan2(y, x)), axis=1).astype("<f4")


@reads("a .btf file")
def read_ubo(path: str | os.PathLike[str]) -> UboFile:
    """Read a file that `write_ubo` wrote; raise FabricError for any other.

    Every count in the file is checked against the file's length before memory of that size is
    allocated.
    """
    source = readable_file(path)
    # Map the file instead of reading it: the factors are copied as floats anyway.
    data = np.memmap(source, np.uint8, "r")
    head = data[: len(PER_CHANNEL)].tobytes()
    joint = head.startswith(JOINT)
    if not joint and not head.startswith(PER_CHANNEL):
        raise FabricError(str(path), "is not a .btf file; it must hold FMF or DFMF factors")
    reader = _Reader(str(path), data, len(JOINT if joint else PER_CHANNEL))
    # Copying a signalling NaN warns; values that are not finite are counted and refused below.
    with np.errstate(invalid="ignore"):
        one = _parse(reader, joint)
    require_whole(str(path), one.directions, one.factors, one.size)
    return one


class _Reader:
    """Reads numbers from a file in sequence, and never beyond its end."""

    def __init__(self, where: str, data: NDArray[np.uint8], at: int) -> None:
        self.where = where
        self.data = data
        self.at = at

    def take(self, form: struct.Struct, what: str) -> tuple[Any, ...]:
        """Read the fields of `form`."""
        self.require(form.size, what)
        values = form.unpack_from(self.data.data, self.at)
        self.at += form.size
        return values

    def array(self, kind: str, shape: tuple[int, ...], what: str) -> NDArray[np.float32]:
        """Read numbers of the type `kind` and convert them to floats."""
        count = math.prod(shape)
        self.require(count * np.dtype(kind).itemsize, what)
        values = np.frombuffer(self.data, kind, count, self.at).reshape(shape)
        self.at += values.nbytes
        return values.astype(np.float32)

    def require(self, size: int, what: str) -> None:
        """Raise FabricError if fewer than `size` bytes remain."""
        left = len(self.data) - self.at
        if size > left:
            raise FabricError(
                self.where,
                f"is damaged: after byte {self.at} it has {left} more bytes; it must have {size} "
                f"for {what}",
            )

    def equal(self, found: object, wanted: object, what: str) -> None:
        """Raise FabricError if a number in the file is inconsistent with the others."""
        if found != wanted:
            raise FabricError(self.where, f"is damaged: {what} is {found}; it must be {wanted}")


def _parse(reader: _Reader, joint: bool) -> UboFile:
    header, version, *_ = reader.take(_HEADER, "a header")
    reader.equal((header, version), (_HEADER.size, _VERSION), "(header size, version)")
    angles = _read_angles(reader)
    views = len(angles)
    w, h = reader.take(_TWO, "a picture's size")
    groups = []
    if joint:
        (rank,) = reader.take(_ONE, "a rank")
        groups.append(_read_matrix(reader, views * views, 3, h * w, "the matrix"))
        reader.equal(rank, groups[0][1].shape[1], "the rank")
    else:
        most, _ = reader.take(_TWO, "ranks")
        reader.array("<f4", (12,), "colours")
        for channel in ("red", "green", "blue"):
            groups.append(_read_matrix(reader, views * views, 1, h * w, f"the matrix of {channel}"))
        reader.equal(most, max(c.shape[1] for _, c in groups), "the largest rank")
    reader.equal(len(reader.data) - reader.at, 0, "the number of bytes after the last matrix")
    theta, phi = angles.T
    directions = np.stack((np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)))
    rows, columns = zip(*groups, strict=True)
    return UboFile(
        directions=directions.T,
        size=(h, w),
        factors=Factors(rows=rows, columns=columns, delta_e=float("nan")),
    )


def _read_angles(reader: _Reader) -> NDArray[np.float64]:
    """(d, 2) inclination and azimuth of the views [rad]; the lights of each must be the same."""
    (views,) = reader.take(_ONE, "a number of views")
    reader.require(views * (8 + _ONE.size + 8 * views), f"directions of {views} views")
    angles = np.empty((views, 2))
    for k in range(views):
        angles[k] = reader.array("<f4", (2,), "a view")
        (lights,) = reader.take(_ONE, "a number of lights")
        reader.equal(lights, views, f"the number of lights of view {k}")
        reader.array("<f4", (views, 2), "lights")
    require_finite(reader.where, "angles", angles)
    return angles


def _read_matrix(
    reader: _Reader, pairs: int, channels: int, texels: int, what: str
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(pairs, channels, rank) and (texels, rank) factors."""
    kind, rank = reader.take(_KIND, f"{what}'s rank")
    reader.equal(kind, _HALF, f"{what}'s type of number")
    sizes = reader.take(_TWO, f"{what}'s size")
    reader.equal(sizes, (pairs * channels, texels), f"the size of {what}")
    reader.require(2 * rank * (1 + pairs * channels + texels), f"{what} of rank {rank}")
    reader.array("<f2", (rank,), "singular values")
    rows = reader.array("<f2", (pairs, channels, rank), "left vectors")
    return rows, reader.array("<f2", (texels, rank), "right vectors")

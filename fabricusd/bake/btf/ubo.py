"""`.btf` files as the University of Bonn's 2014 database has them.

Per channel (`DFMF`) or joint (`FMF`) full-matrix factorisations in half floats. Laid out from the
behaviour of independent readers: a header, the directions by view, the size, then for each matrix
its rank, singular values, left vectors and right vectors times singular values. Rows of the picture
run from the top in the readers, from the bottom in the file.
"""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.btf.factors import Factors
from fabricusd.bake.btf.matrix import Btf
from fabricusd.errors import FabricError, reads
from fabricusd.files import readable_file, whole_file

JOINT, PER_CHANNEL = b"!FMF06FC", b"!DFMF08FC"

_HEADER = struct.Struct("<II80s80s80s4f")
_VERSION = 1


@dataclass(frozen=True, kw_only=True, eq=False)
class UboFile:
    """What a file holds: directions (d, 3), size (h, w) and factors."""

    directions: NDArray[np.float64]
    size: tuple[int, int]
    factors: Factors


def write_ubo(path: str | os.PathLike[str], btf: Btf, made: Factors) -> None:
    """Write a table's factors, whole or not at all."""
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
    """Factors and singular values as halves, scaled so that neither side leaves their range."""
    size = np.maximum(np.abs(rows).max(axis=(0, 1)), 1e-20)
    norms = np.linalg.norm(columns, axis=0)
    u, c = (rows / size).astype("<f2"), (columns * size).astype("<f2")
    if not (np.isfinite(u).all() and np.isfinite(c).all()):
        raise FabricError("btf", f"has values up to {float(np.abs(columns * size).max()):.3g}; "
                          "half floats reach 65504")  # fmt: skip
    return u, c, norms.astype("<f2")


def _angles(directions: NDArray[np.float64]) -> NDArray[np.float32]:
    """(d, 2) inclination and azimuth [rad]."""
    x, y, z = directions.T
    return np.stack((np.arccos(np.clip(z, -1, 1)), np.arctan2(y, x)), axis=1).astype("<f4")


@reads("a .btf file")
def read_ubo(path: str | os.PathLike[str]) -> UboFile:
    """Read what `write_ubo` wrote; FabricError for anything else."""
    data = readable_file(path).read_bytes()
    joint = data.startswith(JOINT)
    if not joint and not data.startswith(PER_CHANNEL):
        raise FabricError(str(path), "is no .btf file of FMF or DFMF factors")
    try:
        return _parse(data, joint)
    except (struct.error, ValueError) as error:
        raise FabricError(str(path), f"is damaged: {error}") from error


def _parse(data: bytes, joint: bool) -> UboFile:
    at = len(JOINT if joint else PER_CHANNEL) + _HEADER.size

    def take(form: str) -> tuple[int, ...]:
        nonlocal at
        values = struct.unpack_from(form, data, at)
        at += struct.calcsize(form)
        return values

    def array(kind: str, *shape: int) -> NDArray[np.float32]:
        nonlocal at
        count = int(np.prod(shape))
        values = np.frombuffer(data, kind, count, at).reshape(shape)
        at += values.nbytes
        return values.astype(np.float32)

    (views,) = take("<I")
    angles = np.empty((views, 2))
    for k in range(views):
        angles[k] = array("<f4", 2)
        take("<I")
        array("<f4", views, 2)
    w, h = take("<II")
    rows, columns = [], []
    if joint:
        rank, _, _ = take("<IBI")
        take("<II")
        array("<f2", rank)
        rows.append(array("<f2", views * views, 3, rank))
        columns.append(array("<f2", h * w, rank))
    else:
        take("<II")
        array("<f4", 12)
        for _ in range(3):
            _, rank = take("<BI")
            take("<II")
            array("<f2", rank)
            rows.append(array("<f2", views * views, 1, rank))
            columns.append(array("<f2", h * w, rank))
    theta, phi = angles.T
    directions = np.stack((np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)))
    return UboFile(
        directions=directions.T,
        size=(h, w),
        factors=Factors(rows=tuple(rows), columns=tuple(columns), delta_e=float("nan")),
    )

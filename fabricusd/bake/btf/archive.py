"""Arrays of an `.npz` archive, whose sizes are judged before their data is read.

`numpy.load` believes what the archive says of itself: a kilobyte may ask for gigabytes.
"""

from __future__ import annotations

import math
import os
import zipfile
from collections.abc import Mapping
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from fabricusd.bake.btf.damage import damage_in
from fabricusd.errors import FabricError
from fabricusd.files import readable_file

MOST_GROWTH = 50
"""Most times that an archive's data may be larger than the archive; half floats shrink to a third,
a bomb to a thousandth."""

SPARE = 16 * 1024 * 1024
"""Bytes that data may have however small the archive is: black cloth shrinks like a bomb."""


def read_arrays(
    path: str | os.PathLike[str], wanted: Mapping[str, int], kind: str
) -> dict[str, NDArray[Any]]:
    """The arrays `wanted` of the `.npz` file `path`; each has as many axes as `wanted` says.

    Raises FabricError, naming the file, for what is no archive of these arrays of numbers, for
    Python objects in it, and for data out of proportion to the file, before it is read.
    """
    source = readable_file(path)
    where = str(source)
    with damage_in(where, kind), zipfile.ZipFile(source) as archive:
        infos = {}
        for name in wanted:
            try:
                infos[name] = archive.getinfo(f"{name}.npy")
            except KeyError:
                raise FabricError(
                    where, f"has no array '{name}'; {kind} must have {', '.join(wanted)}"
                ) from None
        total = sum(info.file_size for info in infos.values())
        most = SPARE + MOST_GROWTH * source.stat().st_size
        if total > most:
            raise FabricError(
                where, f"unpacks to {total} bytes; {kind} of its size must have at most {most}"
            )
        arrays = {}
        for name, info in infos.items():
            with archive.open(info) as stream:
                arrays[name] = _array(f"{where} '{name}'", stream, info.file_size, wanted[name])
        return arrays


def _array(where: str, stream: IO[bytes], size: int, axes: int) -> NDArray[Any]:
    """The array of an `.npy` stream of `size` bytes."""
    version = npy.read_magic(stream)
    if version not in ((1, 0), (2, 0)):
        raise FabricError(where, f"is of version {version}; it must be 1.0 or 2.0")
    read_header = npy.read_array_header_1_0 if version[0] == 1 else npy.read_array_header_2_0
    shape, by_column, dtype = read_header(stream)
    if dtype.hasobject or dtype.kind not in "fiu" or dtype.itemsize > 8:
        what = "Python objects" if dtype.hasobject else f"values of type {dtype}"
        raise FabricError(where, f"holds {what}; it must hold real numbers of at most 64 bits")
    if len(shape) != axes:
        raise FabricError(where, f"has shape {shape}; it must have {axes} axes")
    left = size - stream.tell()
    if min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize != left:
        raise FabricError(where, f"has shape {shape} of {dtype}, but {left} bytes of data")
    data = np.frombuffer(stream.read(left), dtype)
    return data.reshape(shape, order="F" if by_column else "C")

"""Read arrays from an untrusted `.npz` archive; their sizes are checked before any data is read.

`numpy.load` trusts the sizes that an archive states: a kilobyte may demand gigabytes of memory.
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
"""Largest ratio of an archive's data to its size. Half floats compress to a third, a zip bomb to a
thousandth."""

SPARE = 16 * 1024 * 1024
"""Bytes of data that are always allowed: black cloth compresses as well as a zip bomb."""


def read_arrays(
    path: str | os.PathLike[str], wanted: Mapping[str, int], kind: str
) -> dict[str, NDArray[Any]]:
    """Read the arrays `wanted` of the `.npz` file `path`.

    wanted : number of axes by array name
    kind : what the file should be, with an article, for errors

    Raises FabricError, naming the file, if it is not an archive of these arrays of numbers or holds
    Python objects, and, before reading the data, if it unpacks to too many bytes for its size.
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
                where, f"unpacks to {total} bytes; {kind} of its size may have at most {most}"
            )
        arrays = {}
        for name, info in infos.items():
            with archive.open(info) as stream:
                arrays[name] = _array(f"{where} '{name}'", stream, info.file_size, wanted[name])
        return arrays


def _array(where: str, stream: IO[bytes], size: int, axes: int) -> NDArray[Any]:
    """Read the array of an `.npy` stream of `size` bytes."""
    version = npy.read_magic(stream)
    if version not in ((1, 0), (2, 0)):
        raise FabricError(where, f"has the .npy version {version}; it must be 1.0 or 2.0")
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

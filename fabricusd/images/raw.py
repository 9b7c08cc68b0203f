"""Raw frames of a sensor: one code per site, as the file has them, without colour or gamma."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from fabricusd.errors import FabricError, reads
from fabricusd.files import readable_file, whole_file
from fabricusd.images.files import quietly, reason_of, require_plausible

Codes = NDArray[Any]

RAW_SUFFIXES = (".dng", ".cr2", ".nef", ".arw", ".raf", ".rw2")
"""Files of cameras, which `rawpy` reads."""

_prints = threading.Lock()
"""libpng and LibRaw print what is wrong with a file. Silencing them redirects the process's
standard error, which only one thread may do at a time. Other formats print nothing, and are read
side by side."""


@reads("a raw frame")
def read_codes(path: str | os.PathLike[str]) -> Codes:
    """(h, w) uint8 or uint16 codes of a raw frame with one channel.

    TIFF, PNG and PGM keep the codes of their file, be they of 8, 10, 12 or 16 bits. Raises
    FabricError for other pictures, for a file that is not whole, and, for the formats of cameras,
    where `rawpy` is not installed.
    """
    where = str(readable_file(path))
    suffix = Path(where).suffix.lower()
    read = _camera_codes if suffix in RAW_SUFFIXES else _picture_codes
    if suffix in RAW_SUFFIXES or suffix == ".png":
        with _prints, quietly():
            return read(where)
    return read(where)


def _picture_codes(where: str) -> Codes:
    reader: Any = oiio.ImageInput.open(where)
    if reader is None:
        raise FabricError(where, f"cannot be read as a raw frame: {reason_of(oiio)}")
    try:
        return _codes_of(where, reader)
    finally:
        reader.close()


def _codes_of(where: str, reader: Any) -> Codes:
    spec = reader.spec()
    if spec.nchannels != 1 or spec.depth > 1 or spec.deep:
        raise FabricError(
            where, f"has {spec.nchannels} channels; a raw frame must have one code per site"
        )
    if spec.format.basetype not in (oiio.UINT8, oiio.UINT16):
        raise FabricError(where, f"holds {spec.format}; a raw frame must hold 8 or 16 bit integers")
    require_plausible(where, spec)
    pixels = reader.read_image(0, 0, 0, 1, spec.format.basetype)
    if pixels is None:
        raise FabricError(where, f"is not whole: {reason_of(reader)}")
    codes: Codes = np.asarray(pixels)[:, :, 0]
    if Path(where).suffix.lower() in (".pgm", ".pnm"):
        codes = _unscaled(codes, _largest_of_pgm(where))
    return codes


def _largest_of_pgm(where: str) -> int:
    """The largest code that a PGM's header states."""
    with open(where, "rb") as stream:
        words: list[bytes] = []
        while len(words) < 4:
            line = stream.readline(1000)
            if not line:
                raise FabricError(where, "ends within its header; it must be a whole PGM")
            words += line.partition(b"#")[0].split()
    return int(words[3])


def _unscaled(codes: Codes, largest: int) -> Codes:
    """OpenImageIO stretches a PGM's codes to the full range of their type, rounded down."""
    full = np.iinfo(codes.dtype).max
    if largest in (0, full):
        return codes
    table = -(-np.arange(full + 1, dtype=np.int64) * largest // full)
    table = table.astype(codes.dtype)
    return np.asarray(table[codes])


def _camera_codes(where: str) -> Codes:
    try:
        import rawpy
    except ImportError:
        raise FabricError(
            where, "needs rawpy, which is not installed; run pip install 'fabricusd[raw]'"
        ) from None
    with rawpy.imread(where) as raw:
        codes = np.array(raw.raw_image_visible)
    if codes.ndim != 2:
        raise FabricError(
            where, f"has shape {codes.shape}; a raw frame must have one code per site"
        )
    return codes


def write_codes(path: str | os.PathLike[str], codes: Codes, *, durable: bool = True) -> None:
    """Write (h, w) uint8 or uint16 codes as they are, to a TIFF, PNG or PGM told by the suffix.

    durable : as in `files.whole_file`
    """
    kind = oiio.UINT16 if codes.dtype == np.uint16 else oiio.UINT8
    spec = oiio.ImageSpec(codes.shape[1], codes.shape[0], 1, kind)
    with whole_file(path, durable=durable) as temporary:
        output: Any = oiio.ImageOutput.create(str(temporary))
        if output is None:
            raise FabricError(str(path), "does not name a raw frame; it must end in .tif or .pgm")
        data = np.ascontiguousarray(codes)[..., None]
        if not (output.open(str(temporary), spec) and output.write_image(data) and output.close()):
            raise FabricError(str(path), f"cannot be written: {reason_of(output)}")

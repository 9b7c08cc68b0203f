"""Reading flat pictures of bounded size band by band, for drafts drawn as images."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.files import readable_file
from fabricusd.images.files import quietly, reason_of, require_plausible

BAND = 4 * 1024 * 1024
"""Bytes of pixels that are read at a time."""


@contextmanager
def _at_most(megabytes: int) -> Iterator[None]:
    """Make formats refuse a large picture that would be allocated as soon as it is opened."""
    name = "limits:imagesize_MB"
    before = oiio.get_int_attribute(name)
    oiio.attribute(name, megabytes)
    try:
        yield
    finally:
        oiio.attribute(name, before)


def _require_decodable(where: str, most_bytes: int) -> None:
    """Raise for a JPEG 2000 that takes more memory than that: opening one decodes all of it."""
    with open(where, "rb") as stream:
        head = stream.read(512)
    form = ">IIH"  # height, width and channels of the box; width and height of the codestream
    at = head.find(b"ihdr") + 4 if head[4:8] == b"jP  " else 0
    if head.startswith(b"\xff\x4f\xff\x51"):
        at = 8
    if not 0 < at <= len(head) - struct.calcsize(form):
        return
    sides = struct.unpack_from(form, head, at)
    channels = sides[2] if head[4:8] == b"jP  " else 4
    size = 4 * sides[0] * sides[1] * max(channels, 1)
    if size > most_bytes:
        raise FabricError(
            where,
            f"is a JPEG 2000 of {sides[1]} x {sides[0]} pixels, {size} bytes when read; it must "
            f"have at most {most_bytes}",
        )


class FlatImage:
    """A flat picture in a file, which can be read band by band, repeatedly.

    width, height, channels : of the pixels that are read; at most 4 channels
    alpha : index of the channel of opacity, or -1
    linear : True if the values are linear floats, False if they are display codes
    several : whether the file holds more pictures after this one

    Raises FabricError, before a pixel is read, unless the file is a flat image of 1 to `largest`
    pixels per side and at most `most_pixels` altogether.
    """

    def __init__(self, path: str | os.PathLike[str], largest: int, most_pixels: int) -> None:
        self.where = str(readable_file(path))
        self.most_bytes = 2 * most_pixels
        with quietly():
            reader = self._open()
            spec = reader.spec()
            self._require_flat(spec, largest, most_pixels)
            self.several = bool(reader.seek_subimage(1, 0))
            reason_of(reader)  # drop the error of a second picture, which is never read
            reader.close()
        self.width, self.height = int(spec.width), int(spec.height)
        self.channels = min(int(spec.nchannels), 4)
        self.linear = spec.format.basetype in (oiio.HALF, oiio.FLOAT, oiio.DOUBLE)
        self.alpha = spec.alpha_channel if 0 <= spec.alpha_channel < self.channels else -1

    def _open(self) -> Any:
        _require_decodable(self.where, self.most_bytes)
        with _at_most(self.most_bytes >> 20):
            reader: Any = oiio.ImageInput.open(self.where)
        if reader is None:
            raise FabricError(self.where, f"is not an image that can be read ({reason_of(oiio)})")
        return reader

    def _require_flat(self, spec: Any, largest: int, most_pixels: int) -> None:
        sides = (spec.width, spec.height)
        if not (1 <= min(sides) <= max(sides) <= largest and spec.depth <= 1):
            raise FabricError(
                self.where,
                f"is {spec.width} x {spec.height} x {spec.depth} pixels; it must be flat, and from "
                f"1 to {largest} pixels per side",
            )
        tile = spec.tile_width * spec.tile_height
        if max(spec.width * spec.height, tile) > most_pixels:
            raise FabricError(
                self.where,
                f"has {max(spec.width * spec.height, tile)} pixels; it must have at most "
                f"{most_pixels}",
            )
        if spec.deep or spec.nchannels < 1:
            raise FabricError(
                self.where, "does not have one colour per pixel; it must be a flat image"
            )
        require_plausible(self.where, spec)
        if spec.image_bytes(True) > self.most_bytes:
            raise FabricError(
                self.where,
                f"has {spec.image_bytes(True)} bytes of pixels; it must have at most "
                f"{self.most_bytes}",
            )

    def bands(self) -> Iterator[NDArray[np.uint8] | NDArray[np.float32]]:
        """(rows, width, channels) uint8 display codes or float32 linear values, from the top.

        Raises FabricError if the file ends before the picture does.
        """
        with quietly():
            reader = self._open()
            spec = reader.spec()
        kind = oiio.FLOAT if self.linear else oiio.UINT8
        wide = self.width * self.channels * (4 if self.linear else 1)
        unit = spec.tile_height or 64
        step = max(1, BAND // (wide * unit)) * unit
        for begin in range(0, self.height, step):
            end = min(begin + step, self.height)
            y, x = spec.y + begin, spec.x
            with quietly():
                if spec.tile_width:
                    pixels = reader.read_tiles(
                        x, x + self.width, y, spec.y + end, 0, 1, 0, self.channels, kind
                    )
                else:
                    pixels = reader.read_scanlines(y, spec.y + end, 0, 0, self.channels, kind)
                reason = reason_of(reader)
            if pixels is None or reason:
                raise FabricError(
                    self.where,
                    f"cannot be read to its end ({reason or 'no pixels'}); it must be a complete "
                    "image",
                )
            yield np.asarray(pixels).reshape(end - begin, self.width, self.channels)
        with quietly():
            reader.close()

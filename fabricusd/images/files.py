"""Reading and writing picture files: EXR with layers and metadata, PNG, textures. OpenImageIO is
used only here, in `images.flat` and in `images.ocio`."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from fabricusd.errors import FabricError, one_line, reads
from fabricusd.files import readable_file, whole_file
from fabricusd.srgb import linear_from_srgb

REC_709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""Chromaticities x and y of red, green, blue and white: the colour space of every rendering."""

OPENIMAGEIO: str = oiio.VERSION_STRING
"""Version of the library that reads and writes."""


def reason_of(source: Any) -> str:
    """The error of `source`, or of OpenImageIO itself, on one line: it may quote a damaged file."""
    try:
        return one_line(str(source.geterror()), 200)
    except UnicodeDecodeError:
        return "its header is not text"


@contextmanager
def quietly() -> Iterator[None]:
    """Silence libraries such as libpng, which print to file descriptor 2 without Python."""
    try:
        kept = os.dup(2)
    except OSError:  # closed
        yield
        return
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nothing)


def write_exr(
    path: str | os.PathLike[str],
    layers: Mapping[str, NDArray[Any]],
    channels: Mapping[str, tuple[str, ...]],
    metadata: Mapping[str, Any],
) -> None:
    """Write float32 layers (h, w, c) to one EXR: `beauty` as R, G, B, A, others as `layer.channel`.

    metadata : name -> str, int or float

    The file is written whole or not at all; raises FabricError if it cannot be written.
    """
    names, planes = [], []
    for layer, pixels in layers.items():
        for k, channel in enumerate(channels[layer]):
            names.append(channel if layer == "beauty" else f"{layer}.{channel}")
            planes.append(pixels[..., k])
    data = np.ascontiguousarray(np.stack(planes, axis=-1), np.float32)
    spec = oiio.ImageSpec(data.shape[1], data.shape[0], data.shape[2], oiio.FLOAT)
    spec.channelnames = tuple(names)
    spec.attribute("compression", "zip")
    spec.attribute("oiio:ColorSpace", "lin_rec709")
    spec.attribute("chromaticities", "float[8]", REC_709)
    for key, value in metadata.items():
        # Integers in an EXR header have 32 bits.
        fits = not isinstance(value, int) or -(2**31) <= value < 2**31
        kept = isinstance(value, int | float | str) and fits
        spec.attribute(key, value if kept else str(value))
    _write(path, spec, data)


def write_png(
    path: str | os.PathLike[str],
    pixels: NDArray[np.uint8] | NDArray[np.uint16],
    *,
    color_space: str = "sRGB",
    metadata: Mapping[str, str | float] | None = None,
) -> None:
    """Write (h, w, c) uint8 or uint16 code values to a PNG, whole or not at all.

    color_space : "sRGB" for colours, "raw" for data
    metadata : texts and numbers by OpenImageIO's names, for example "XResolution"
    """
    kind = oiio.UINT16 if pixels.dtype == np.uint16 else oiio.UINT8
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    spec.attribute("oiio:ColorSpace", color_space)
    # Store the code values as they are: keep OpenImageIO from dividing by the fourth channel.
    spec.attribute("oiio:UnassociatedAlpha", 1)
    for key, value in (metadata or {}).items():
        spec.attribute(key, value)
    _write(path, spec, np.ascontiguousarray(pixels))


def _write(path: str | os.PathLike[str], spec: Any, data: NDArray[Any]) -> None:
    with whole_file(path) as temporary:
        output = oiio.ImageOutput.create(str(temporary))
        if output is None:
            raise FabricError(
                str(path), "does not name a picture format; it must end in .exr or .png"
            )
        try:
            good = output.open(str(temporary), spec) and output.write_image(data) and output.close()
            reason = reason_of(output)
        finally:
            # The writer completes the file when it is destroyed. After an interrupt, libpng prints
            # a complaint then.
            with quietly():
                del output
        if not good:
            raise FabricError(str(path), f"cannot be written: {reason}")


MOST_GROWTH = 2000
"""Largest ratio of a picture's size to that of its file; no usual compression reaches it."""

SPARE = 32 * 1024 * 1024
"""Bytes that a picture may have, however small its file is."""


def require_plausible(where: str, spec: Any) -> None:
    """Raise if a picture is out of proportion to its file, before memory is allocated for it."""
    size = float(spec.image_bytes(True))
    most = SPARE + MOST_GROWTH * os.path.getsize(where)
    if not 0 < size <= most:
        raise FabricError(
            where,
            f"claims {spec.width} x {spec.height} pixels of {spec.nchannels} channels, "
            f"{size:.4g} bytes; a complete file of its size has at most {most}",
        )


@reads("a picture")
def read_image(
    path: str | os.PathLike[str], *, color_space: str = "auto", most: int = 0
) -> NDArray[np.float32]:
    """(h, w, c) float32, linear, c being 1 or 3; raises FabricError if it cannot be read.

    Colours are returned as stored: they are neither multiplied nor divided by opacity.

    color_space : "auto" decodes sRGB in 8-bit pictures, "sRGB" always, "raw" never
    most : shrink to at most this many pixels per side; 0 keeps all
    """
    pixels, spec = _stored_pixels(path)
    pixels = _shrunk(pixels[..., :3] if pixels.shape[2] >= 3 else pixels[..., :1], most)
    eight_bit = spec.format.basetype == oiio.UINT8
    if color_space == "sRGB" or (color_space == "auto" and eight_bit):
        pixels = linear_from_srgb(pixels).astype(np.float32)
    return np.ascontiguousarray(pixels, np.float32)


@reads("a picture")
def read_alpha(path: str | os.PathLike[str], *, most: int = 0) -> NDArray[np.float32]:
    """(h, w, 1) float32 opacity of a picture, one pixel of 1 if it has none; see `read_image`."""
    pixels, spec = _stored_pixels(path)
    channel = spec.alpha_channel
    if not 0 <= channel < pixels.shape[2]:
        return np.ones((1, 1, 1), np.float32)
    return np.ascontiguousarray(_shrunk(pixels[..., channel : channel + 1], most), np.float32)


def _stored_pixels(path: str | os.PathLike[str]) -> tuple[NDArray[np.float32], Any]:
    """((h, w, c) float32 values as they are stored in the file, the file's specification)."""
    plain = oiio.ImageSpec()
    plain.attribute("oiio:UnassociatedAlpha", 1)
    pixels, buffer = _buffer_pixels(path, 0, plain)
    return pixels, buffer.nativespec()


def _buffer_pixels(
    path: str | os.PathLike[str], level: int = 0, config: Any = None, part: int = 0
) -> tuple[NDArray[np.float32], Any]:
    """((h, w, c) float32 values of one mip level of one part, the buffer that holds them).

    Raises FabricError for a file that is not a picture, is damaged, or cannot be as large as it
    claims.
    """
    where = str(readable_file(path))
    with quietly():
        buffer: Any = oiio.ImageBuf(where, part, level, config or oiio.ImageSpec())
        if buffer.has_error or level >= max(buffer.nmiplevels, 1):
            reason = reason_of(buffer)
            if level:
                reason = f"there is no mip level {level} ({reason or 'it has fewer'})"
            raise FabricError(where, f"cannot be read as a picture: {reason}")
        spec = buffer.spec()
        if spec.deep or spec.depth > 1:
            raise FabricError(where, "is a deep or volumetric picture; it must be flat")
        require_plausible(where, spec)
        pixels = None
        if buffer.read(part, level, True, oiio.FLOAT):
            pixels = buffer.get_pixels(oiio.FLOAT)
        reason = reason_of(buffer)
    if pixels is None or pixels.size == 0:
        raise FabricError(where, f"cannot be read as a picture: {reason or 'it has no pixels'}")
    return np.asarray(pixels, np.float32), buffer


def _shrunk(pixels: NDArray[np.float32], most: int) -> NDArray[np.float32]:
    """Means of square blocks, so that no side is longer than `most`; unchanged if that is 0."""
    longest = max(pixels.shape[:2])
    if not most or longest <= most:
        return pixels
    step = -(-longest // most)
    h, w = pixels.shape[0] // step * step, pixels.shape[1] // step * step
    blocks = pixels[:h, :w].reshape(h // step, step, w // step, step, -1)
    return np.asarray(blocks.mean(axis=(1, 3)))


@reads("a picture")
def read_exr_layers(
    path: str | os.PathLike[str],
) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
    """(name -> layer (h, w, c), metadata of the first part) of an EXR, of all of its parts.

    A layer is named by its channels, or by its part where they have no name of their own; the first
    part's is the beauty. A part of another size than the first is left out, as is a layer that an
    earlier part has already.
    """
    pixels, buffer = _buffer_pixels(path)
    first = buffer.spec()
    metadata = {a.name: a.value for a in first.extra_attribs}
    found = _layers(pixels, first, "beauty")
    for part in range(1, buffer.nsubimages):
        pixels, buffer = _buffer_pixels(path, part=part)
        if pixels.shape[:2] == (first.height, first.width):
            own = _part_name(buffer.spec(), part)
            found = _layers(pixels, buffer.spec(), own) | found
    return found, metadata


def _layers(pixels: NDArray[np.float32], spec: Any, own: str) -> dict[str, NDArray[np.float32]]:
    """Name -> layer (h, w, c); own : name of the channels that name no layer."""
    planes: dict[str, list[NDArray[np.float32]]] = {}
    for k, name in enumerate(spec.channelnames):
        layer, _, _ = name.rpartition(".")
        planes.setdefault(layer or own, []).append(pixels[..., k])
    return {layer: np.stack(p, axis=-1) for layer, p in planes.items()}


def _part_name(spec: Any, part: int) -> str:
    return str(spec.getattribute("oiio:subimagename") or f"part {part}")


@reads("a picture")
def parts_of(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Names of the parts of a picture file. Most have one; `read_image` reads the first."""
    where = str(readable_file(path))
    with quietly():
        buffer: Any = oiio.ImageBuf(where)
        count = max(buffer.nsubimages, 1)
        return tuple(_part_name(oiio.ImageBuf(where, k, 0).spec(), k) for k in range(count))


def write_mip_exr(
    path: str | os.PathLike[str],
    levels: Sequence[Callable[[], Iterator[NDArray[Any]]]],
    size: int,
    channels: tuple[str, ...],
    kind: type[Any],
    metadata: Mapping[str, Any],
) -> None:
    """Write a square mip-mapped EXR in tiles of 64, zip compressed, band by band.

    levels : for each level, a function that yields its rows from the top, as (rows, size, channels)
        arrays of `kind`, np.float16 or np.float32; a height is a multiple of 64 or the whole level

    The file is written whole or not at all; raises FabricError if it cannot be written.
    """
    half = np.dtype(kind) == np.float16
    with whole_file(path) as temporary:
        output: Any = oiio.ImageOutput.create(str(temporary))
        good = output is not None
        for level, bands in enumerate(levels):
            side = size >> level
            spec = oiio.ImageSpec(side, side, len(channels), oiio.HALF if half else oiio.FLOAT)
            spec.channelnames = channels
            spec.tile_width = spec.tile_height = 64
            spec.attribute("compression", "zip")
            spec.attribute("openexr:levelmode", 1)
            spec.attribute("textureformat", "Plain Texture")
            spec.attribute("wrapmodes", "clamp,clamp")
            # With the time of writing, two files of the same pixels would differ.
            spec.attribute("DateTime", "1970:01:01 00:00:00")
            for key, value in metadata.items():
                spec.attribute(key, value if isinstance(value, int | float | str) else str(value))
            mode = "Create" if level == 0 else "AppendMIPLevel"
            good = good and output.open(str(temporary), spec, mode)
            row = 0
            for band in bands() if good else ():
                end = row + band.shape[0]
                good = good and output.write_tiles(0, side, row, end, 0, 1, band)
                row = end
        good = good and output.close()
        reason = reason_of(output) if output is not None else "no EXR writer"
        # The writer completes the file when it is destroyed.
        del output
        if not good:
            raise FabricError(str(path), f"cannot be written: {reason}")


def write_16_bit(
    path: str | os.PathLike[str],
    bands: Iterable[NDArray[np.uint16]],
    size: int,
    channels: int,
    metadata: Mapping[str, Any],
) -> None:
    """Write a square PNG or TIFF, told by the suffix, of 16-bit numbers, band by band.

    bands : rows from the top, (rows, size, channels). To two channels a third of 0 is added, since
        both formats would take two for grey and opacity.

    The file is written whole or not at all; raises FabricError if it cannot be written.
    """
    kept = 3 if channels == 2 else channels
    with whole_file(path) as temporary:
        output: Any = oiio.ImageOutput.create(str(temporary))
        spec = oiio.ImageSpec(size, size, kept, oiio.UINT16)
        spec.channelnames = ("Y",) if kept == 1 else ("R", "G", "B", "A")[:kept]
        # The fourth channel is data: keep OpenImageIO from dividing by it.
        spec.attribute("oiio:UnassociatedAlpha", 1)
        spec.attribute("compression", "zip")
        spec.attribute("DateTime", "1970:01:01 00:00:00")
        for key, value in metadata.items():
            spec.attribute(key, value)
        good = output is not None and output.open(str(temporary), spec)
        row = 0
        try:
            for band in bands if good else ():
                pixels = np.zeros((*band.shape[:2], kept), np.uint16)
                pixels[..., :channels] = band
                good = good and output.write_scanlines(row, row + len(band), 0, pixels)
                row += len(band)
            good = good and output.close()
            reason = reason_of(output) if output is not None else "no writer"
        finally:
            with quietly():
                del output
        if not good:
            raise FabricError(str(path), f"cannot be written: {reason}")


@reads("a picture")
def read_mip_level(path: str | os.PathLike[str], level: int = 0) -> NDArray[np.float32]:
    """(h, w, c) float32 pixels of one mip level, with the values stored in the file."""
    plain = oiio.ImageSpec()
    # The fourth channel is data: keep OpenImageIO from multiplying by it.
    plain.attribute("oiio:UnassociatedAlpha", 1)
    return _buffer_pixels(path, level, plain)[0]


@reads("a picture")
def shape_of(path: str | os.PathLike[str]) -> tuple[int, int, int]:
    """(height, width, channels) from the header of a picture's file; no pixel is read."""
    where = str(readable_file(path))
    with quietly():
        source: Any = oiio.ImageInput.open(where)
        if source is None:
            raise FabricError(where, f"cannot be read as a picture: {reason_of(oiio)}")
        spec = source.spec()
    return int(spec.height), int(spec.width), int(spec.nchannels)


@reads("a picture")
def read_part(
    path: str | os.PathLike[str], most: int, around: tuple[float, float] = (0.5, 0.5)
) -> NDArray[np.float32]:
    """(h, w, c) float32, a part of a square texture, at most `most` pixels per side.

    most : a multiple of 64; of a tiled texture, only the tiles of the part are read
    around : (u, v) of the part's middle, as near as tiles allow; v is 0 at the bottom
    """
    where = str(readable_file(path))
    with quietly():
        source: Any = oiio.ImageInput.open(where)
        if source is None:
            raise FabricError(where, f"cannot be read as a picture: {reason_of(oiio)}")
        spec = source.spec()
        require_plausible(where, spec)
        side, channels = spec.width, spec.nchannels
        if spec.height != side or spec.deep:
            raise FabricError(
                where, f"is {side} x {spec.height} pixels; it must be a square texture"
            )
        size = min(side, most)
        left, top = (
            min(max(round(at * side - size / 2), 0), side - size) // 64 * 64
            for at in (around[0], 1.0 - around[1])
        )
        right, below = left + size, top + size
        if spec.tile_width:
            pixels = source.read_tiles(left, right, top, below, 0, 1, 0, channels, oiio.FLOAT)
        else:
            pixels = source.read_scanlines(top, below, 0, 0, channels, oiio.FLOAT)
            pixels = pixels if pixels is None else pixels[:, left:right]
        reason = reason_of(source)
    if pixels is None:
        raise FabricError(where, f"cannot be read as a picture: {reason}")
    return np.asarray(pixels, np.float32).reshape(size, size, -1)

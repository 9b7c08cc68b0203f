"""Text on pictures."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from fabricusd.errors import FabricError


def labelled(
    pixels: NDArray[np.uint8], labels: list[tuple[int, int, str]], size: int, color: int
) -> NDArray[np.uint8]:
    """(h, w, 3) codes with texts in a sans-serif font `size` pixels high, in a grey of `color`.

    labels : (x, y, text), with (x, y) the left end of the text's base line [pixels]

    Raises FabricError where OpenImageIO has no font.
    """
    h, w, channels = pixels.shape
    picture = oiio.ImageBuf(oiio.ImageSpec(w, h, channels, oiio.UINT8))
    picture.set_pixels(oiio.ROI(0, w, 0, h, 0, 1, 0, channels), np.ascontiguousarray(pixels))
    for x, y, text in labels:
        ink = (color / 255.0,) * channels
        if not oiio.ImageBufAlgo.render_text(picture, x, y, text, size, "", ink):
            raise FabricError("the labels", f"cannot be drawn: {picture.geterror()}")
    return np.asarray(picture.get_pixels(oiio.UINT8))

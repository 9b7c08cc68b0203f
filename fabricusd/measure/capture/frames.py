"""Reading the frames of a folder, each checked against the first: size, largest code, wholeness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.images.raw import read_codes
from fabricusd.measure.capture.manifest import Manifest, Shot

Codes = NDArray[Any]


@dataclass(frozen=True, kw_only=True)
class Frame:
    """The part of every frame that is used.

    shape : (h, w) of a file; top, bottom : rows that are used; left, right : the thread's window
    """

    shape: tuple[int, int]
    top: int
    bottom: int
    left: int
    right: int

    @property
    def height(self) -> int:
        """Rows that are used."""
        return self.bottom - self.top

    @property
    def sites(self) -> int:
        """Sites of the thread's window."""
        return self.height * (self.right - self.left)


def frame_of(manifest: Manifest, shape: tuple[int, int]) -> Frame:
    """Rows and window within frames of `shape`, on whole 2 x 2 blocks of the colour filter.

    Raises FabricError for a window that leaves no background, or lies outside of the frame.
    """
    h, w = shape
    rows = manifest.rows or (0, h)
    left, right = manifest.window or (w // 6, w - w // 6)
    where = str(manifest.folder)
    if not (0 <= rows[0] < rows[1] <= h and 0 <= left < right <= w):
        raise FabricError(
            where,
            f"has the window {left} to {right} and the rows {rows[0]} to {rows[1]}; they must lie "
            f"within its frames of {w} x {h}",
        )
    made = Frame(
        shape=shape, top=rows[0] // 2 * 2, bottom=rows[1] // 2 * 2, left=left // 2 * 2,
        right=right // 2 * 2,
    )  # fmt: skip
    if made.height < 2 or made.right - made.left < 2 or w - (made.right - made.left) < 4:
        raise FabricError(
            where,
            f"has frames of {w} x {h} and the window {left} to {right}; there must be two rows, "
            "two columns of thread, and four of background",
        )
    return made


def read_frame(manifest: Manifest, shot: Shot, shape: tuple[int, int] | None = None) -> Codes:
    """(h, w) codes of a shot; FabricError for another size than `shape`, for codes too large."""
    path = manifest.folder / shot.file
    codes = read_codes(path)
    if shape is not None and codes.shape != shape:
        raise FabricError(
            str(path),
            f"has {codes.shape[1]} x {codes.shape[0]} pixels; it must have "
            f"{shape[1]} x {shape[0]}, as the other frames",
        )
    if manifest.levels < np.iinfo(codes.dtype).max:
        largest = int(codes.max(initial=0))
        if largest > manifest.levels:
            raise FabricError(
                str(path),
                f"holds the code {largest}; with {manifest.bits} bits it must be at most "
                f"{manifest.levels}",
            )
    return codes

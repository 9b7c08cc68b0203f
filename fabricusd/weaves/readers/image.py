"""Images: drawdowns in black and white, and pictures in the threads' colours."""

from __future__ import annotations

from fabricusd.errors import FabricError
from fabricusd.weaves.draft import Draft, with_colors
from fabricusd.weaves.image.read import read_image
from fabricusd.weaves.readers import DraftOptions, DraftReader


def _read(path: str, options: DraftOptions) -> Draft:
    """Given colours tell the warp of a coloured image from its weft; a drawdown, they colour."""
    told = bool(options.warp or options.weft)
    try:
        draft = read_image(path, invert=options.invert)
    except FabricError:
        if not told:
            raise
        return read_image(path, warp_colors=options.warp, weft_colors=options.weft)
    if draft.colored and told:
        return read_image(path, warp_colors=options.warp, weft_colors=options.weft)
    return with_colors(draft, options.warp, options.weft)


READER = DraftReader(help="a drawdown, black where warp is on top", read=_read)

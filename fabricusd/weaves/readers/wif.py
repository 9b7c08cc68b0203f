"""WIF drafts."""

from __future__ import annotations

from fabricusd.errors import FabricError
from fabricusd.weaves.draft import Draft, with_colors
from fabricusd.weaves.readers import DraftOptions, DraftReader
from fabricusd.weaves.wif.read import read_wif


def _read(path: str, options: DraftOptions) -> Draft:
    if options.invert:
        raise FabricError("--invert", "can only be used with an image")
    draft = read_wif(path)
    return with_colors(draft, options.warp, options.weft) if options.warp or options.weft else draft


READER = DraftReader(help="a WIF draft", read=_read)

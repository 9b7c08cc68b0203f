"""Recognition of files that are given as WIF but are not, so that the refusal names their kind."""

from __future__ import annotations

import os
from pathlib import Path

from fabricusd.errors import FabricError

DRAFT_SUFFIXES = {
    ".dtx": "a .dtx draft (Fiberworks)",
    ".wpo": "a .wpo draft (WeavePoint)",
    ".twa": "a .twa draft (TempoWeave)",
}
"""Drafts of other programs, all of which can export WIF."""

EXPORT = "export it as WIF"

BEGINNINGS = (
    (b"@@StartDTX", DRAFT_SUFFIXES[".dtx"], EXPORT),
    (b"PK\x03\x04", "a ZIP archive, as TempoWeave's .twa is", "export the draft as WIF"),
    (b"\x89PNG", "a PNG picture", "read it with --image"),
    (b"\xff\xd8\xff", "a JPEG picture", "read it with --image"),
    (b"GIF8", "a GIF picture", "read it with --image"),
    (b"II*\0", "a TIFF picture", "read it with --image"),
    (b"MM\0*", "a TIFF picture", "read it with --image"),
    (b"v/1\x01", "an EXR picture", "read it with --image"),
    (b"#usda", "a USD layer", "it must be a WIF draft"),
    (b"PXR-USDC", "a USD layer", "it must be a WIF draft"),
    (b"%PDF", "a PDF document", "it must be a WIF draft"),
)
"""(first bytes, what such a file is, what the user should do)."""


def refuse_other_drafts(path: str | os.PathLike[str], head: bytes) -> None:
    """Raise FabricError if the file `path`, which begins with `head`, is known not to be WIF.

    A file that has [WIF] in its first bytes is taken for a WIF draft, whatever its name is.
    """
    if b"[WIF]" in head.upper().replace(b"\0", b""):
        return
    text = head.removeprefix(b"\xef\xbb\xbf").replace(b"\0", b"").removeprefix(b"\xff\xfe")
    for start, kind, advice in BEGINNINGS:
        if head.startswith(start) or text.lstrip().startswith(start):
            raise FabricError(str(path), f"is {kind}; {advice}")
    kind = DRAFT_SUFFIXES.get(Path(path).suffix.lower(), "")
    if kind:
        raise FabricError(str(path), f"is {kind}, judging by its name; {EXPORT}")

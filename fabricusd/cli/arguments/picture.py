"""`--picture`: a small picture of the fabric that a command makes, changes or describes."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fabricusd.errors import FabricError

if TYPE_CHECKING:
    from fabricusd.fabric import Fabric

SIZE = 256
"""Pixels along each side."""


def add_picture(parser: argparse.ArgumentParser) -> None:
    """The option."""
    parser.add_argument(
        "--picture", metavar="PNG",
        help="also write a picture of the fabric on a cylinder, as 'preview' makes it, "
        f"{SIZE} pixels wide",
    )  # fmt: skip


def require_picture_name(options: argparse.Namespace) -> None:
    """Refuse now a picture that could not be written when the rest is done."""
    from fabricusd.files import require_writable

    if options.picture is None:
        return
    path = Path(options.picture)
    if path.suffix.lower() != ".png":
        raise FabricError(f"--picture {path}", "is no name for a picture; it must end in .png")
    require_writable(path, clobber=not getattr(options, "no_clobber", False))


def leave_picture(fabric: Fabric, options: argparse.Namespace) -> None:
    """Write the picture, if one is asked for."""
    from fabricusd.files import whole_file
    from fabricusd.preview.picture import thumbnail

    if options.picture is None:
        return
    with whole_file(options.picture) as temporary:
        temporary.write_bytes(thumbnail(fabric, SIZE))

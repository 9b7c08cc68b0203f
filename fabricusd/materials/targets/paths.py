"""Paths from a written file to another, so that a folder can be moved as a whole."""

from __future__ import annotations

import os
from pathlib import Path


def asset_path(target: Path, folder: Path) -> str:
    """`target` relative to `folder`, with forward slashes and a leading `./` or `../`.

    Absolute only where there is no relative path, on another drive.
    """
    try:
        relative = Path(os.path.relpath(target.absolute(), folder.absolute())).as_posix()
    except ValueError:
        return target.absolute().as_posix()
    return relative if relative.startswith("../") else f"./{relative}"

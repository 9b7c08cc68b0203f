"""Make paths between files relative, so that a folder can be moved as a whole."""

from __future__ import annotations

import os
from pathlib import Path


def asset_path(target: Path, folder: Path) -> str:
    """Return `target` relative to `folder`, with forward slashes and a leading `./` or `../`.

    The path is absolute if `target` is on another drive.
    """
    try:
        relative = Path(os.path.relpath(target.absolute(), folder.absolute())).as_posix()
    except ValueError:
        return target.absolute().as_posix()
    return relative if relative.startswith("../") else f"./{relative}"

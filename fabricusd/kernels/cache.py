"""Compiled kernels on disk, thrown away when any source they were made from has changed.

numba keys a cached kernel by its own file alone. A kernel holds what it calls, inlined, so a change
in another file would leave it stale without a word: after an edit, and after an upgrade too.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
FOLDERS = ("appearance", "reference", "bake")
STAMP = "kernels.stamp"


def fingerprint(folders: list[Path]) -> str:
    """A digest of name, size and time of every source in `folders`."""
    digest = hashlib.sha256()
    for folder in folders:
        for entry in sorted(os.scandir(folder), key=lambda e: e.name):
            if entry.name.endswith(".py"):
                info = entry.stat()
                line = f"{folder.name}/{entry.name} {info.st_size} {info.st_mtime_ns}\n"
                digest.update(line.encode())
    return digest.hexdigest()


def forget_stale_kernels(package: Path = PACKAGE) -> bool:
    """Delete the kernels cached beside the sources if those differ from the last time.

    Returns whether it did. Does nothing where the package's folders cannot be written: numba
    then caches elsewhere, under a name that holds the path alone.
    """
    folders = [package / name for name in FOLDERS if (package / name).is_dir()]
    stamp = package / "__pycache__" / STAMP
    now = fingerprint(folders)
    # Without a stamp, whatever is cached is of unknown age.
    try:
        if stamp.exists() and stamp.read_bytes() == now.encode():
            return False
        for folder in folders:
            for pattern in ("*.nbi", "*.nbc"):
                for cached in (folder / "__pycache__").glob(pattern):
                    cached.unlink(missing_ok=True)
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text(now)
    except OSError:
        return False
    return True

"""Where numba keeps compiled kernels: a folder for each state of all the sources.

numba looks at a kernel's own file alone to tell whether its machine code is still right. A kernel
holds what it calls, inlined, and constants of other modules, so a change in another file would
leave it stale. Here the folder is named by a digest of every source that kernels may read: nothing
stale is ever found, nothing has to be deleted, and two versions can run side by side.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numba

from fabricusd.cache import KERNELS, cache_folder
from fabricusd.kernels.internals import use_internals

PACKAGE = Path(__file__).resolve().parents[1]
FOLDERS = ("kernels", "appearance", "scene", "run", "reference", "bake", "geometry")
"""Folders of the package whose modules hold kernels, or constants that kernels read."""


def sources(package: Path = PACKAGE) -> list[Path]:
    """Every source that may end up in a kernel, in order."""
    found = list(package.glob("*.py"))
    for name in FOLDERS:
        found += (package / name).rglob("*.py")
    return sorted(found)


def fingerprint(package: Path = PACKAGE) -> str:
    """A digest of the sources' names and contents, of numba's version, and of how it is used."""
    compiler = f"{numba.__version__} {use_internals()}"
    digest = hashlib.blake2b(compiler.encode(), digest_size=10)
    for path in sources(package):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def use_cache() -> None:
    """Let numba keep kernels in the user's cache. A folder that NUMBA_CACHE_DIR names stays."""
    if "NUMBA_CACHE_DIR" not in os.environ:
        numba.config.CACHE_DIR = str(cache_folder(KERNELS, fingerprint()))

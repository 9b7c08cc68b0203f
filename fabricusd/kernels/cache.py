"""Choose where numba caches compiled kernels: in a folder for each state of the sources.

numba decides whether cached machine code is still valid by looking at the kernel's own file. But a
kernel also contains the functions it inlines and constants of other modules, so a change to another
file would leave it stale. This module therefore names the folder by a digest of every source that
kernels may read. Stale kernels cannot be loaded, nothing has to be deleted, and two versions of the
package can run side by side. Inside the folder, names do not depend on where the package lies, so
that installations of one version share their kernels.
"""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import numba

from fabricusd.cache import KERNELS, cache_folder
from fabricusd.kernels.internals import use_internals
from fabricusd.kernels.ready import unpack_into

PACKAGE = Path(__file__).resolve().parents[1]
FOLDERS = (
    "kernels", "appearance", "scene", "run", "reference", "bake", "geometry", "preview/kernels",
)  # fmt: skip
"""Folders of the package whose modules hold kernels, or constants that kernels read."""


def sources(package: Path = PACKAGE) -> list[Path]:
    """Every source file that may end up in a kernel, sorted by path."""
    found = list(package.glob("*.py"))
    for name in FOLDERS:
        found += (package / name).rglob("*.py")
    return sorted(found)


@lru_cache(maxsize=1)
def fingerprint() -> str:
    """`digest_of` the package as it was when this process first asked."""
    return digest_of(PACKAGE)


def digest_of(package: Path) -> str:
    """A digest of the sources' names and contents, numba's version, and whether its internals are
    used."""
    compiler = f"{numba.__version__} {use_internals()}"
    digest = hashlib.blake2b(compiler.encode(), digest_size=10)
    for path in sources(package):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def use_cache() -> None:
    """Make numba cache kernels in the user's cache, unless NUMBA_CACHE_DIR names a folder."""
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    folder = cache_folder(KERNELS, fingerprint())
    numba.config.CACHE_DIR = str(folder)
    if use_internals():
        with suppress(ImportError, AttributeError):
            from fabricusd.kernels.locator import locate_in

            locate_in(folder, PACKAGE, fingerprint())
            unpack_into(folder)

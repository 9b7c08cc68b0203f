"""Kernels that were compiled beforehand: a package may bring them, so that nobody has to wait.

`fabricusd cache --pack FILE` compiles what the commands need, for each level of processor
(`processor.LEVELS`). A file in `FOLDER`, which a wheel may bring, is unpacked into the cache when
its kernels are those of the package's sources, of this version of Python and numba, and of this
system. Everything else is compiled when it is needed, as without such a file.
"""

from __future__ import annotations

import os
import sys
import sysconfig
from contextlib import suppress
from pathlib import Path

FOLDER = Path(__file__).parent / "ready"
"""Where the package's own files of kernels lie."""

VARIABLE = "FABRICUSD_READY_KERNELS"
"""Set to 0, no kernels are unpacked."""

_DONE = ".unpacked"
"""File in a folder of kernels into which nothing has to be unpacked any more."""


def file_name() -> str:
    """The name of the file for this version of Python and this system."""
    return f"{sys.implementation.cache_tag}-{sysconfig.get_platform()}.zip"


def pack(folder: Path, file: Path) -> int:
    """Write the kernels in `folder`, which the sources' digest names, to a file; returns how many.

    Raises OSError.
    """
    import zipfile

    # In a fixed order and without times, so that the same kernels make the same file.
    paths = sorted(path for path in folder.rglob("*.nb?") if path.is_file())
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as target:
        for path in paths:
            name = f"{folder.name}/{path.relative_to(folder).as_posix()}"
            target.writestr(zipfile.ZipInfo(name), path.read_bytes(), zipfile.ZIP_DEFLATED)
    return sum(path.suffix == ".nbc" for path in paths)


def unpack_into(folder: Path) -> None:
    """Unpack the package's kernels into `folder`, once. Those that are there stay; a file that
    cannot be read, or has kernels of other sources, is no kernel's loss but time."""
    file = FOLDER / file_name()
    if os.environ.get(VARIABLE) == "0" or not file.exists() or (folder / _DONE).exists():
        return
    # Imported here, because every command would wait for it.
    import zipfile

    # A damaged file raises what its damage makes of it.
    with suppress(Exception), zipfile.ZipFile(file) as source:
        names = [name for name in source.namelist() if name.startswith(f"{folder.name}/")]
        # An index (.nbi) after the code (.nbc) it names: another process may be reading.
        for name in sorted(names, key=lambda name: (name.endswith(".nbi"), name)):
            target = folder / name.partition("/")[2]
            if not target.exists():
                _write(target, source.read(name))
        (folder / _DONE).touch()


def _write(target: Path, content: bytes) -> None:
    """Write a file that is whole from the moment it is there."""
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f"{target.name}.tmp.{os.urandom(8).hex()}")
    try:
        temporary.write_bytes(content)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)

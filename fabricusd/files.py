"""Files that appear whole or not at all: written under a temporary name, renamed when done."""

from __future__ import annotations

import json
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from fabricusd.errors import FabricError
from fabricusd.partial_files import (
    partial_prefix,
    remove_partial_files,
    remove_partial_files_once,
)

__all__ = ["readable_file", "remove_partial_files", "require_writable", "whole_file"]


@contextmanager
def whole_file(
    path: str | os.PathLike[str], *, clobber: bool = True, durable: bool = True
) -> Iterator[Path]:
    """Yield a temporary path beside `path`, and rename it to `path` if the block succeeds.

    The temporary name keeps the suffix, since many writers choose their format by it. An existing
    file is replaced in one step; with `clobber` False it is refused before anything is written. A
    symbolic link is kept and its target replaced; devices and pipes are refused. Half-written files
    that a killed process left in the folder are removed.

    durable : wait until the content is on the disk before the file is renamed, so that not even a
        power failure leaves half a file; False for files that are verified or remade in any case
    """
    target, temporary = _begin(path, clobber=clobber)
    try:
        yield temporary
        # mkstemp makes files private; a user's files follow the umask.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        if durable:
            _sync(temporary)
        temporary.replace(target)
        if durable:
            _sync_folder(target.parent)
    except OSError as error:
        raise FabricError(str(target), f"cannot be written: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def require_writable(path: str | os.PathLike[str], *, clobber: bool = True) -> None:
    """Raise now what `whole_file` would otherwise raise after the work is done."""
    _begin(path, clobber=clobber)[1].unlink(missing_ok=True)


def _sync(path: Path) -> None:
    """Wait until the content of a file is on the disk."""
    handle = os.open(path, os.O_RDWR | getattr(os, "O_BINARY", 0))
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _sync_folder(folder: Path) -> None:
    """Wait until the names in a folder are on the disk, if the system supports that."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _begin(path: str | os.PathLike[str], *, clobber: bool) -> tuple[Path, Path]:
    """(the file to write, an empty temporary file beside it)."""
    target = Path(os.path.realpath(path)) if os.path.islink(path) else Path(path)
    # os.path returns False where pathlib raises: for names that are too long, unreadable folders.
    if os.path.isdir(target):
        raise FabricError(str(target), "is a directory; it must be the name of a file")
    if os.path.exists(target) and not os.path.isfile(target):
        raise FabricError(str(target), "is a pipe or a device; it must be the name of a file")
    if not clobber and os.path.lexists(target):
        raise FabricError(str(target), "exists; it must be a new name with --no-clobber")
    if not os.path.isdir(target.parent):
        raise FabricError(
            str(target), f"is in '{target.parent}', which is not a directory; create it first"
        )
    try:
        # The temporary name is shorter, so this is where a name that is too long has to fail.
        with suppress(FileNotFoundError):
            os.lstat(target)
        remove_partial_files_once(target.parent)
        handle, name = tempfile.mkstemp(
            prefix=partial_prefix(target.stem), suffix=target.suffix, dir=target.parent
        )
    except OSError as error:
        raise FabricError(str(target), f"cannot be written: {error.strerror}") from error
    except ValueError as error:
        raise FabricError(repr(str(target)), f"is not a file name: {error}") from None
    os.close(handle)
    return target, Path(name)


def readable_file(path: str | os.PathLike[str], missing: str = "") -> Path:
    """`path`, if it is a regular file that can be opened and is not empty.

    Raises FabricError otherwise; `missing` is its message if nothing has that name.
    """
    if not os.fspath(path):
        raise FabricError("''", "is empty; it must be the name of a file")
    source = Path(path)
    try:
        mode = source.stat().st_mode
        if stat.S_ISDIR(mode):
            raise FabricError(str(source), "is a directory; it must be a file")
        if not stat.S_ISREG(mode):
            raise FabricError(str(source), "is a pipe or a device; it must be a file")
        with source.open("rb") as stream:
            if not stream.read(1):
                raise FabricError(str(source), "is empty; it must hold something")
    except OSError as error:
        gone = missing and isinstance(error, FileNotFoundError | NotADirectoryError)
        problem = missing if gone else f"cannot be read: {error.strerror}"
        raise FabricError(str(source), problem) from error
    except ValueError as error:
        if isinstance(error, FabricError):
            raise
        raise FabricError(repr(str(source)), f"is not a file name: {error}") from None
    return source


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file, whole; its bytes depend on the value alone."""
    with whole_file(path) as temporary:
        temporary.write_text(
            json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False) + "\n", "utf-8"
        )

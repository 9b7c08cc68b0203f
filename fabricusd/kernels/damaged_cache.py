"""Recover from a damaged kernel cache: delete unreadable kernels and compile them again.

A killed process, a full disk or a failing disk can leave cache files that make numba raise in every
later run, or that contain machine code with a wrong byte. This module appends a checksum to each
file, behind the part that numba reads, and treats any error while loading a kernel as if the kernel
had not been cached.
"""

from __future__ import annotations

import hashlib
import pickle
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core.caching import Cache, IndexDataCacheFile

_MARK = b"fabricusd-sha256"
_SIZE = len(_MARK) + hashlib.sha256().digest_size


def forgive_damage() -> None:
    """Install the recovery in numba's cache classes, in this process only; repeated calls do
    nothing."""
    if Cache._load_overload is _load_or_compile:
        return
    IndexDataCacheFile._save_data, IndexDataCacheFile._load_data = _save_code, _load_code
    IndexDataCacheFile._save_index, IndexDataCacheFile._load_index = _save_index, _read_index
    Cache._load_overload = _load_or_compile
    Cache._save_overload = _save_if_possible


# numba's own methods.
_load_overload, _save_overload = Cache._load_overload, Cache._save_overload
_load_index = IndexDataCacheFile._load_index


def _load_or_compile(cache: Cache, signature: Any, context: Any) -> Any:
    """The cached kernel, or None, which makes numba compile it, if it cannot be loaded."""
    try:
        return _load_overload(cache, signature, context)
    except Exception:
        # The file may belong to another user.
        with suppress(OSError):
            _forget(cache._cache_file)
        return None


def _forget(file: IndexDataCacheFile) -> None:
    """Delete a kernel's index and its machine code for every signature."""
    index = Path(file._index_path)
    index.unlink(missing_ok=True)
    for code in index.parent.glob(f"{index.stem}.*.nbc"):
        code.unlink(missing_ok=True)


def _save_if_possible(cache: Cache, signature: Any, data: Any) -> None:
    """Save a kernel. If the disk is full or read-only, the kernel runs without being cached."""
    with suppress(OSError):
        _save_overload(cache, signature, data)


def _save_code(file: IndexDataCacheFile, name: str, data: Any) -> None:
    _write_sealed(file, file._data_path(name), file._dump(data))


def _load_code(file: IndexDataCacheFile, name: str) -> Any:
    path = Path(file._data_path(name))
    content = path.read_bytes()
    _require_whole(path, content)
    return pickle.loads(content)


def _save_index(file: IndexDataCacheFile, overloads: dict[Any, str]) -> None:
    version = pickle.dumps(file._version, protocol=-1)
    stamped = file._dump((file._source_stamp, overloads))
    _write_sealed(file, file._index_path, version + stamped)


def _read_index(file: IndexDataCacheFile) -> Any:
    path = Path(file._index_path)
    if path.exists():
        _require_whole(path, path.read_bytes())
    return _load_index(file)


def _write_sealed(file: IndexDataCacheFile, path: str, content: bytes) -> None:
    with file._open_for_write(path) as stream:
        stream.write(content + _MARK + hashlib.sha256(content).digest())


def _require_whole(path: Path, content: bytes) -> None:
    """Raise ValueError if the checksum differs; files written by plain numba have no checksum."""
    end = content[-_SIZE:]
    if end.startswith(_MARK) and end[len(_MARK) :] != hashlib.sha256(content[:-_SIZE]).digest():
        raise ValueError(f"{path} is damaged")

"""Kernels on disk that cannot be read: deleted and compiled again, instead of ending every run.

A process that was killed, a full disk or a failing one leaves files that numba trips over, or that
hold machine code with a wrong byte. So a checksum follows the content of each file, after the end
of what numba reads of it, and whatever goes wrong in loading a kernel means that it was not on
disk.
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
    """Let numba's caches, this process's alone, do as this module says; as often as you like."""
    if Cache._load_overload is _load_or_compile:
        return
    IndexDataCacheFile._save_data, IndexDataCacheFile._load_data = _save_code, _load_code
    IndexDataCacheFile._save_index, IndexDataCacheFile._load_index = _save_index, _read_index
    Cache._load_overload = _load_or_compile
    Cache._save_overload = _save_if_possible


# As numba has them.
_load_overload, _save_overload = Cache._load_overload, Cache._save_overload
_load_index = IndexDataCacheFile._load_index


def _load_or_compile(cache: Cache, signature: Any, context: Any) -> Any:
    """What is on disk; None, which makes numba compile, where that cannot be loaded."""
    try:
        return _load_overload(cache, signature, context)
    except Exception:
        # Its file may be another user's.
        with suppress(OSError):
            _forget(cache._cache_file)
        return None


def _forget(file: IndexDataCacheFile) -> None:
    """Delete the index of a kernel, and its code for every signature."""
    index = Path(file._index_path)
    index.unlink(missing_ok=True)
    for code in index.parent.glob(f"{index.stem}.*.nbc"):
        code.unlink(missing_ok=True)


def _save_if_possible(cache: Cache, signature: Any, data: Any) -> None:
    """Save a kernel; a disk that is full or read-only is no reason not to run it."""
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
    """ValueError where the checksum differs; files that numba alone has written have none."""
    end = content[-_SIZE:]
    if end.startswith(_MARK) and end[len(_MARK) :] != hashlib.sha256(content[:-_SIZE]).digest():
        raise ValueError(f"{path} is damaged")

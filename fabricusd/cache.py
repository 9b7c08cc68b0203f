"""What fabricusd keeps on disk to save time: compiled kernels, and tables that take long to make.

Everything lies below one folder of the user's, `FABRICUSD_CACHE_DIR` or the platform's cache
folder, as `KIND/KEY/...`. A key names everything that its content depends on, so an entry is never
out of date; at most, nobody asks for it any more. Losing the whole cache costs time, nothing else.
"""

from __future__ import annotations

import hashlib
import io
import math
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
from numpy.typing import NDArray

VARIABLE = "FABRICUSD_CACHE_DIR"
KERNELS = "kernels"

MOST_BYTES = 1 << 30
"""Size above which the least recently used entries are removed: room for some 20 versions."""

KEPT_SECONDS = 24 * 3600.0
"""An entry used within this time is not removed to make room: a running process may need it."""

PRUNED_EVERY = 60.0
"""Seconds for which a process that creates entries does not count them again: each has to be
looked at, and there may be thousands."""

_USED = ".used"
"""File in each entry; its modification time says when the entry was last asked for."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One KIND/KEY of the cache.

    used : when it was last asked for, in seconds since the epoch
    """

    kind: str
    key: str
    size: int
    used: float


@lru_cache(maxsize=8)
def _root_of(chosen: str) -> Path:
    """The cache's folder; a private temporary one where that cannot be written."""
    folder = Path(chosen) if chosen else Path(platformdirs.user_cache_dir("fabricusd", False))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        user = getattr(os, "getuid", lambda: "user")()
        folder = Path(tempfile.gettempdir()) / f"fabricusd-cache-{user}"
        folder.mkdir(mode=0o700, exist_ok=True)
    return folder


def root() -> Path:
    """The folder of the whole cache."""
    return _root_of(os.environ.get(VARIABLE, ""))


def cache_folder(kind: str, key: str) -> Path:
    """The folder of an entry, created if necessary and marked as used now.

    Before it creates an entry, old entries are removed to keep the cache below MOST_BYTES, at most
    every PRUNED_EVERY seconds.
    """
    folder = root() / kind / key
    if not folder.is_dir():
        _prune_now_and_then()
        folder.mkdir(parents=True, exist_ok=True)
    # A cache that cannot be written can still be read.
    with suppress(OSError):
        (folder / _USED).touch()
    return folder


def kept(kind: str, key: Iterable[object], make: Callable[[], NDArray[Any]]) -> NDArray[Any]:
    """The array that `make` returns, from the cache if it was made before.

    key : what the array depends on: arrays, and objects whose `repr` says all that matters
    """
    digest = hashlib.blake2b(digest_size=10)
    for part in key:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype} {part.shape}".encode())
            digest.update(np.ascontiguousarray(part).data)
        else:
            digest.update(repr(part).encode())
    name = digest.hexdigest()
    path = cache_folder(kind, name) / "array.npy"
    watch = _watch.get()
    # Whatever is wrong with the file, the array can be made again.
    with suppress(OSError, ValueError, EOFError):
        found = np.asarray(np.load(path, allow_pickle=False))
        watch.note(kind, name, found)
        return found
    if watch.only_known and kind in watch.kinds:
        raise Unknown(kind)
    made = make()
    _write(path, made)
    watch.note(kind, name, made)
    return made


class Unknown(LookupError):
    """An array of that kind is not in the cache, where `only_known` asks for none to be made."""


@dataclass(frozen=True, kw_only=True)
class _Watch:
    """What is done with arrays of some kinds, beside keeping them."""

    kinds: frozenset[str] = frozenset()
    only_known: bool = False
    notes: list[tuple[str, str, NDArray[Any]]] = field(default_factory=list)

    def note(self, kind: str, name: str, array: NDArray[Any]) -> None:
        if kind in self.kinds and not self.only_known:
            self.notes.append((kind, name, array))


_watch: ContextVar[_Watch] = ContextVar("watch", default=_Watch())  # noqa: B039, without kinds


@contextmanager
def recorded(*kinds: str) -> Iterator[list[tuple[str, str, NDArray[Any]]]]:
    """A context in which every array of these kinds that is asked for is noted.

    The notes are the arguments of `keep`, with which another machine knows the arrays, too.
    """
    watch = _Watch(kinds=frozenset(kinds))
    token = _watch.set(watch)
    try:
        yield watch.notes
    finally:
        _watch.reset(token)


@contextmanager
def only_known(*kinds: str) -> Iterator[None]:
    """A context in which an array of these kinds that is not in the cache raises `Unknown`."""
    token = _watch.set(_Watch(kinds=frozenset(kinds), only_known=True))
    try:
        yield
    finally:
        _watch.reset(token)


def keep(kind: str, name: str, array: NDArray[Any]) -> None:
    """Put an array into the cache that `kept` made elsewhere, as `recorded` noted it."""
    _write(cache_folder(kind, name) / "array.npy", array)


def _write(path: Path, made: NDArray[Any]) -> None:
    with suppress(OSError):
        handle, partial = tempfile.mkstemp(dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as stream:
                np.save(stream, made)
            os.replace(partial, path)
        except BaseException:
            os.unlink(partial)
            raise


def kept_groups(
    kind: str,
    key: Iterable[object],
    make: Callable[[], Mapping[str, Any]],
    kinds: Mapping[str, Any],
) -> dict[str, Any]:
    """What `make` returns, named arrays, numbers, and named tuples of them, as `kept`.

    kinds : class of each named tuple; None in its place is kept, too
    """
    archive = kept(kind, key, lambda: packed(make()))
    return unpacked(archive, kinds)


def packed(groups: Mapping[str, Any]) -> NDArray[np.uint8]:
    """All arrays and numbers of `kept_groups` as the bytes of an .npz archive."""
    arrays: dict[str, Any] = {}
    for name, group in groups.items():
        if hasattr(group, "_asdict"):
            arrays.update({f"{name}.{field}": value for field, value in group._asdict().items()})
        elif group is not None:
            arrays[name] = group
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return np.frombuffer(stream.getvalue(), np.uint8)


def unpacked(archive: NDArray[np.uint8], kinds: Mapping[str, Any]) -> dict[str, Any]:
    """The inverse of `packed`."""
    with np.load(io.BytesIO(archive.tobytes()), allow_pickle=False) as found:
        arrays = {name: _value(found[name]) for name in found.files}
    out = {name: value for name, value in arrays.items() if "." not in name}
    for name, kind in kinds.items():
        there = any(key.startswith(f"{name}.") for key in arrays)
        out[name] = kind(*(arrays[f"{name}.{field}"] for field in kind._fields)) if there else None
    return out


def _value(array: NDArray[Any]) -> Any:
    """A number where the array has no dimension: whole ones as Python's, reals as they were."""
    if array.ndim:
        return array
    return int(array) if array.dtype.kind in "iub" else array[()]


def entries() -> list[Entry]:
    """All entries, least recently used first."""
    found = []
    for kind in _folders(root()):
        for folder in _folders(kind):
            mark = folder / _USED
            used = mark.stat().st_mtime if mark.exists() else 0.0
            size = sum(f.stat().st_size for f in folder.rglob("*") if f.is_file())
            found.append(Entry(kind=kind.name, key=folder.name, size=size, used=used))
    return sorted(found, key=lambda entry: entry.used)


def prune(most: int = MOST_BYTES, now: float | None = None) -> list[Entry]:
    """Remove the least recently used entries until at most `most` bytes are left; return those."""
    now = time.time() if now is None else now
    known = entries()
    total = sum(entry.size for entry in known)
    removed = []
    for entry in known:
        if total <= most:
            break
        if now - entry.used < KEPT_SECONDS:
            continue
        _remove(entry)
        removed.append(entry)
        total -= entry.size
    return removed


_pruned: dict[Path, float] = {}
"""When this process pruned each cache [seconds of the monotonic clock]."""


def _prune_now_and_then() -> None:
    now = time.monotonic()
    if now - _pruned.get(root(), -math.inf) >= PRUNED_EVERY:
        _pruned[root()] = now
        prune()


def clear() -> list[Entry]:
    """Remove every entry; return what was removed."""
    known = entries()
    for entry in known:
        _remove(entry)
    return known


def _remove(entry: Entry) -> None:
    shutil.rmtree(root() / entry.kind / entry.key, ignore_errors=True)


def _folders(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []

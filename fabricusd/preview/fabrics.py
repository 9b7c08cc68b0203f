"""Find the fabric of a preview: from the cache where that needs neither USD nor a draft's reader.

The fabric of a preset depends on the layers that come with the package, that of a draft on one file
and the options of no one: both are kept by a digest of those files and of the sources that read
them. A USD file of the user's may be composed of any number of files, and is read each time.
"""

from __future__ import annotations

import hashlib
import json
import os
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import numpy as np

from fabricusd.cache import kept
from fabricusd.fabric import Fabric
from fabricusd.preview.stored import from_json, to_json

PACKAGE = Path(__file__).resolve().parents[1]

PRESETS = PACKAGE / "schema" / "presets"
"""Where the layers of the presets are; `schema.source` has the same, and loads USD."""

READERS = ("schema", "weaves", "dye", "appearance/layer", "appearance/scattering", "preview")
"""Folders of the package whose sources say what fabric a source is."""

DRAFTS = 1 << 24
"""Bytes of the largest draft whose fabric is kept."""


def fabric_of(source: str) -> tuple[Fabric, tuple[str, ...]]:
    """(fabric, notes of its reader) of a preset, a draft or a USD file; FabricError as readers."""
    files = _files(source)
    if files is None:
        return _read(source)
    digest = hashlib.blake2b(digest_size=16)
    for path in files:
        digest.update(path.name.encode())
        digest.update(path.read_bytes())

    def made() -> np.ndarray:
        fabric, notes = _read(source)
        text = to_json(fabric)
        said = {"fabric": text, "notes": notes} if from_json(text) == fabric else {}
        return np.frombuffer(json.dumps(said).encode(), np.uint8)

    held = kept("fabrics", (source, digest.hexdigest(), _sources()), made)
    # Whatever is wrong with the entry, the source can be read again.
    with suppress(ValueError, KeyError, TypeError):
        said = json.loads(held.tobytes())
        return from_json(said["fabric"]), tuple(said["notes"])
    return _read(source)


def names_of_presets() -> list[str]:
    """The names of all presets that are cloth, without loading USD: neither yarns nor backs."""
    names = sorted(path.stem for path in (*PRESETS.glob("*.usda"), *PRESETS.glob("trade/*.usda")))
    return [n for n in names if not n.startswith("thread_") and not n.endswith("_back")]


def is_preset(source: str) -> bool:
    """Whether `source` is the name of a preset, with or without a choice of variants."""
    name = source.partition("{")[0]
    layers = (PRESETS / f"{name}.usda", PRESETS / "trade" / f"{name}.usda")
    plain = bool(name) and os.sep not in name and not os.path.exists(source)
    return plain and not os.path.exists(name) and any(path.is_file() for path in layers)


def _read(source: str) -> tuple[Fabric, tuple[str, ...]]:
    from fabricusd.schema.anysource import load_any

    return load_any(source)


def _files(source: str) -> list[Path] | None:
    """The files on which the fabric of `source` depends, or None where that is not known."""
    if is_preset(source):
        return sorted(PRESETS.rglob("*.usda"))
    from fabricusd.weaves.readers import reader_name

    path = Path(source)
    if reader_name(source) and path.is_file() and path.stat().st_size <= DRAFTS:
        return [path]
    return None


@lru_cache(maxsize=1)
def _sources() -> str:
    digest = hashlib.blake2b(digest_size=16)
    paths = list(PACKAGE.glob("*.py"))
    for folder in READERS:
        paths += (PACKAGE / folder).rglob("*.py")
    for path in sorted({*paths, PACKAGE / "schema" / "schema.usda"}):
        digest.update(path.read_bytes())
    return digest.hexdigest()

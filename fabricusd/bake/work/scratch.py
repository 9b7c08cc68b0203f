"""Manage a bake's scratch folder, from which an interrupted bake resumes.

The folder `.bake` in the output folder holds the key of the job, the finished blocks, and a mark
for each finished texture. Every file in it is written atomically. A block whose checksum is wrong
is computed again.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fabricusd.bake.texels.encoding import Encoding, encoding_from
from fabricusd.bake.texels.sheet import Sheet
from fabricusd.errors import FabricError
from fabricusd.files import whole_file

FOLDER = ".bake"

LONGEST = 4096
"""Bytes of the longest key or mark that is read; those written here are shorter."""


class Scratch:
    """The scratch folder of one job, in a locked output folder.

    key : a digest of the job; files of a job with another key cannot be used
    """

    def __init__(self, out: Path, key: str, *, resume: bool) -> None:
        self.folder = out / FOLDER
        if self.folder.is_symlink():
            raise FabricError(str(self.folder), "is a link; it must be a folder: remove the link")
        held = self.folder / "key"
        known = _small_file(held)
        if resume and known is not None and known != key:
            raise FabricError(
                str(out),
                "holds an unfinished bake of another scene, fabric or settings; leave --resume out "
                "to start again",
            )
        try:
            # Blocks without a key may belong to any job.
            if self.folder.exists() and not (resume and known == key):
                shutil.rmtree(self.folder)
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FabricError(str(out), f"cannot be written: {error.strerror}") from error
        with whole_file(held) as temporary:
            temporary.write_text(key)

    def block(self, sheet: Sheet, bx: int, by: int) -> Path:
        """Return the path of a block's file."""
        folder = self.folder / f"{sheet.garment.name}.{sheet.number}"
        folder.mkdir(exist_ok=True)
        return folder / f"{bx}_{by}.block"

    def drop(self, sheet: Sheet) -> None:
        """Delete the blocks of a sheet whose textures are all finished."""
        shutil.rmtree(self.folder / f"{sheet.garment.name}.{sheet.number}", ignore_errors=True)

    def is_done(self, file: Path) -> bool:
        """Whether a texture is finished and unchanged since it was marked."""
        said = self._said(file)
        return said is not None and file.is_file() and said[0] == sha256(file)

    def mark_done(self, file: Path, encoding: Encoding | None = None) -> None:
        """Record that a texture is finished, and how its values are encoded."""
        said = {"sha256": sha256(file), "encoding": encoding and asdict(encoding)}
        with whole_file(self._mark(file)) as temporary:
            temporary.write_text(json.dumps(said), "utf-8")

    def encoding(self, file: Path) -> Encoding | None:
        """Return the encoding of a finished texture; None if it stores the values themselves."""
        said = self._said(file)
        return said[1] if said is not None else None

    def _said(self, file: Path) -> tuple[str, Encoding | None] | None:
        """Return the checksum and encoding in a texture's mark; None if missing or damaged."""
        text = _small_file(self._mark(file))
        try:
            said: Any = json.loads(text or "")
            encoding = said["encoding"]
            return str(said["sha256"]), encoding and encoding_from(encoding)
        except (ValueError, KeyError, TypeError, RecursionError):
            return None

    def _mark(self, file: Path) -> Path:
        return self.folder / f"{file.name}.done"

    @staticmethod
    def remove(out: Path) -> None:
        """Remove the scratch folder of a finished job from an output folder."""
        shutil.rmtree(out / FOLDER, ignore_errors=True)


def _small_file(path: Path) -> str | None:
    """Return the text of a key or a mark: "" if it is unreadable, None if there is no file."""
    if not path.is_file():
        return None
    try:
        with path.open("rb") as stream:
            data = stream.read(LONGEST + 1)
        return data.decode("utf-8") if len(data) <= LONGEST else ""
    except (OSError, ValueError):
        return ""


def sha256(path: Path) -> str:
    """Return the SHA-256 checksum of a file in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()

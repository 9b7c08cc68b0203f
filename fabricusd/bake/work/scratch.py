"""What a bake keeps between its start and its end, so that a killed one can go on.

`.bake` in the output folder holds the key of the job, the blocks that are done and a mark for each
texture that is. Everything in it is written whole; a block whose checksum is wrong counts as none.
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
"""Bytes of a key or a mark: none that was written here has as many."""


class Scratch:
    """The folder of one job, in an output folder that nobody else writes.

    key : what the job is, in one word; another key means that nothing in the folder can be used
    """

    def __init__(self, out: Path, key: str, *, resume: bool) -> None:
        self.folder = out / FOLDER
        if self.folder.is_symlink():
            raise FabricError(str(self.folder), "is a link; it must be a folder of the bake's own")
        held = self.folder / "key"
        known = _small_file(held)
        if resume and known is not None and known != key:
            raise FabricError(
                str(out),
                "holds a bake of another scene, fabric or settings; leave --resume out to start "
                "anew",
            )
        try:
            # Blocks without a key may be of any job.
            if self.folder.exists() and not (resume and known == key):
                shutil.rmtree(self.folder)
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FabricError(str(out), f"cannot be written: {error.strerror}") from error
        with whole_file(held) as temporary:
            temporary.write_text(key)

    def block(self, sheet: Sheet, bx: int, by: int) -> Path:
        """Where a block is kept."""
        folder = self.folder / f"{sheet.garment.name}.{sheet.number}"
        folder.mkdir(exist_ok=True)
        return folder / f"{bx}_{by}.block"

    def drop(self, sheet: Sheet) -> None:
        """Forget the blocks of a sheet whose textures are all done."""
        shutil.rmtree(self.folder / f"{sheet.garment.name}.{sheet.number}", ignore_errors=True)

    def is_done(self, file: Path) -> bool:
        """Whether a texture is there, as it was when it was marked."""
        said = self._said(file)
        return said is not None and file.is_file() and said[0] == sha256(file)

    def mark_done(self, file: Path, encoding: Encoding | None = None) -> None:
        """Remember that a texture is finished, and how its values are stored."""
        said = {"sha256": sha256(file), "encoding": encoding and asdict(encoding)}
        with whole_file(self._mark(file)) as temporary:
            temporary.write_text(json.dumps(said), "utf-8")

    def encoding(self, file: Path) -> Encoding | None:
        """How a finished texture's values are stored; None where they are stored as they are."""
        said = self._said(file)
        return said[1] if said is not None else None

    def _said(self, file: Path) -> tuple[str, Encoding | None] | None:
        """Checksum and encoding by a texture's mark; None where it has none, or a damaged one."""
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
        """Remove the folder of a job that is done from an output folder."""
        shutil.rmtree(out / FOLDER, ignore_errors=True)


def _small_file(path: Path) -> str | None:
    """The text of a key or a mark, "" for what is none; None where there is no such file."""
    if not path.is_file():
        return None
    try:
        with path.open("rb") as stream:
            data = stream.read(LONGEST + 1)
        return data.decode("utf-8") if len(data) <= LONGEST else ""
    except (OSError, ValueError):
        return ""


def sha256(path: Path) -> str:
    """Checksum of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()

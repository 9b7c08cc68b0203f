"""What a bake keeps between its start and its end, so that a killed one can go on.

`.bake` in the output folder holds the key of the job, the blocks that are done and a mark for each
texture that is. Everything in it is written whole; a block whose checksum is wrong counts as none.
"""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

from fabricusd.bake.sheet import Sheet
from fabricusd.errors import FabricError
from fabricusd.files import remove_partial_files, whole_file

FOLDER = ".bake"


class Scratch:
    """The folder of one job.

    key : what the job is, in one word; another key means that nothing in the folder can be used
    """

    def __init__(self, out: Path, key: str, *, resume: bool) -> None:
        self.folder = out / FOLDER
        held = self.folder / "key"
        if resume and held.is_file() and held.read_text() != key:
            raise FabricError(
                str(out),
                "holds a bake of another scene, fabric or settings; leave --resume out to start "
                "anew",
            )
        try:
            if not resume and self.folder.exists():
                shutil.rmtree(self.folder)
            self.folder.mkdir(parents=True, exist_ok=True)
            remove_partial_files(out)
        except OSError as error:
            raise FabricError(str(out), f"cannot be written: {error.strerror}") from error
        if not held.is_file():
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
        mark = self._mark(file)
        if not mark.is_file() or not file.is_file():
            return False
        return mark.read_text().partition("\n")[0] == sha256(file)

    def mark_done(self, file: Path, note: str = "") -> None:
        """Remember that a texture is finished, and a note about it."""
        with whole_file(self._mark(file)) as temporary:
            temporary.write_text(f"{sha256(file)}\n{note}")

    def note(self, file: Path) -> str:
        """What was noted about a finished texture."""
        return self._mark(file).read_text().partition("\n")[2]

    def _mark(self, file: Path) -> Path:
        return self.folder / f"{file.name}.done"

    def close(self) -> None:
        """Remove the folder: the job is done."""
        shutil.rmtree(self.folder, ignore_errors=True)


def sha256(path: Path) -> str:
    """Checksum of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()

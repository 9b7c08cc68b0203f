"""Write Blender's add-on as a file to install, or as a folder."""

from __future__ import annotations

import os
import shutil
import tempfile
import zipfile
from pathlib import Path

from fabricusd.errors import FabricError
from fabricusd.files import whole_file

SOURCE = Path(__file__).resolve().parent / "addon"

NAME = "fabricusd_looks"
"""The add-on's module in Blender."""

MANIFEST = "blender_manifest.toml"

_WHEN = (2020, 1, 1, 0, 0, 0)
"""Time of the files in the ZIP, so that two of the same version are the same bytes."""


def write_addon(path: str | os.PathLike[str], *, clobber: bool = True) -> Path:
    """Write the add-on and return its path: a ZIP file if `path` ends in .zip, or else a folder.

    clobber : whether an existing file, or an add-on in the folder, may be replaced

    Raises FabricError if the path holds anything else, and if it cannot be written.
    """
    path = Path(path)
    check_target(path, clobber=clobber)
    if path.suffix:
        with whole_file(path, clobber=clobber) as temporary:
            _write_zip(temporary)
    else:
        _write_folder(path)
    return path


def check_target(path: Path, *, clobber: bool = True) -> None:
    """Raise FabricError where `write_addon` would refuse to write."""
    if not path.parent.is_dir():
        raise FabricError(str(path), f"is in '{path.parent}', which is not a folder")
    is_zip = path.suffix.lower() == ".zip"
    if path.suffix and not is_zip:
        raise FabricError(
            str(path), f"has the suffix '{path.suffix}'; it must be .zip, or a folder without one"
        )
    if is_zip or not (path.exists() or path.is_symlink()):
        return
    if not path.is_dir() or (any(path.iterdir()) and not (path / MANIFEST).is_file()):
        raise FabricError(str(path), "holds something else; it must be new or an add-on")
    if not clobber and any(path.iterdir()):
        raise FabricError(str(path), "exists; with --no-clobber, give the name of a new folder")


def _files() -> list[Path]:
    return sorted(one for one in SOURCE.iterdir() if one.suffix in (".py", ".toml"))


def _write_zip(path: Path) -> None:
    """In one folder, as add-ons of the earlier kind have it; extensions may have it too."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as package:
        for file in _files():
            entry = zipfile.ZipInfo(f"{NAME}/{file.name}", _WHEN)
            entry.external_attr = 0o644 << 16
            package.writestr(entry, file.read_bytes(), zipfile.ZIP_DEFLATED)


def _write_folder(path: Path) -> None:
    """Write a folder beside `path` and put it in its place."""
    try:
        with tempfile.TemporaryDirectory(dir=path.parent) as beside:
            made = Path(beside) / NAME
            made.mkdir()
            for file in _files():
                shutil.copyfile(file, made / file.name)
            if path.exists():
                path.rename(Path(beside) / "old")
            made.rename(path)
    except OSError as error:
        raise FabricError(str(path), f"cannot be written: {error.strerror}") from error

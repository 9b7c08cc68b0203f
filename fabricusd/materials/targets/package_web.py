"""A look in one file for readers that know no EXR: three.js, AR Quick Look."""

from __future__ import annotations

from pathlib import Path

from fabricusd.errors import FabricError
from fabricusd.files import require_writable
from fabricusd.materials.targets import Job
from fabricusd.materials.targets.package import folder, write_usdz

__all__ = ["check", "folder", "write"]


def check(where: Path, clobber: bool) -> None:
    """Another suffix, and what cannot be written."""
    if where.suffix != ".usdz":
        raise FabricError(f"--usdz-web '{where}'", "has another suffix; it must be .usdz")
    require_writable(where, clobber=clobber)


def write(job: Job, where: Path) -> list[Path]:
    """The package alone."""
    write_usdz(job.look, where, clobber=job.clobber, web=True, note=job.note)
    return [where]

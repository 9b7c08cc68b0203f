"""`--thread FABRIC[:THREAD]`: a thread of a fabric file or a preset."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fabricusd.errors import FabricError, did_you_mean

if TYPE_CHECKING:
    from fabricusd.fabric import Fabric


def named_thread(text: str) -> tuple[Fabric, str]:
    """(the fabric, the name of its thread) that `--thread` asks for, by default its first."""
    from fabricusd.schema.anysource import load_any

    file, _, wanted = text.partition(":")
    fabric, _notes = load_any(file)
    if wanted and wanted not in fabric.threads:
        raise FabricError(
            f"--thread '{text}'",
            f"is not a thread of {file}{did_you_mean(wanted, fabric.threads)}; it must be one of "
            f"{', '.join(fabric.threads)}",
        )
    return fabric, wanted or next(iter(fabric.threads))

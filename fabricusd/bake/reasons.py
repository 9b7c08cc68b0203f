"""Refusals of a bake, with what the scene's reader had to say of their cause."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from fabricusd.errors import FabricError
from fabricusd.reference.scene import Scene

MOST_REASONS = 3
"""Notes of the reader that a refusal repeats."""


@contextmanager
def explained(scene: Scene) -> Iterator[None]:
    """Add to a FabricError of the block the scene's notes on what it is about, a mesh or all."""
    try:
        yield
    except FabricError as error:
        reasons = "".join(f"; {reason}" for reason in _reasons(error, scene.notes))
        if not reasons:
            raise
        raise FabricError(error.where, error.problem + reasons) from error


def _reasons(error: FabricError, notes: list[str]) -> list[str]:
    """The notes that explain a refusal, the best first, without what it says itself."""
    where = error.where
    own = [note for note in notes if note.startswith((f"{where} ", f"{where}."))]
    if where == "the scene":
        # What could not be opened stands first; what is said of fabrics explains more than lights.
        own = sorted(notes, key=lambda note: note.startswith("/") and "fabric" not in note)
    told = error.problem
    found = [note for note in own if note.removeprefix(where).strip().split(";")[0] not in told]
    if len(found) <= MOST_REASONS:
        return found
    more = f"and {len(found) - MOST_REASONS} more, which 'fabricusd render -n' tells"
    return [*found[:MOST_REASONS], more]

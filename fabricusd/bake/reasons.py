"""Add the scene reader's notes to a bake's errors, since they often name the cause."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar

from fabricusd.errors import FabricError
from fabricusd.scene.scene import Scene

P = ParamSpec("P")
T = TypeVar("T")

MOST_REASONS = 3
"""Largest number of the reader's notes that an error repeats."""


def explained(
    make: Callable[Concatenate[Scene, P], T],
) -> Callable[Concatenate[Scene, P], T]:
    """Decorate a function of a scene so that its errors repeat the scene's notes.

    An error about a mesh repeats the notes on that mesh; an error about the whole scene may repeat
    any note. A scene without meshes raises FabricError.
    """

    @wraps(make)
    def made(scene: Scene, /, *args: P.args, **named: P.kwargs) -> T:
        try:
            if not scene.meshes:
                raise FabricError("the scene", "has no mesh that could be baked")
            return make(scene, *args, **named)
        except FabricError as error:
            reasons = "".join(f"; {reason}" for reason in _reasons(error, scene.notes))
            if not reasons:
                raise
            raise FabricError(error.where, error.problem + reasons) from error

    return made


def _reasons(error: FabricError, notes: list[str]) -> list[str]:
    """Return the notes that explain an error, best first, without those that only repeat it."""
    where = error.where
    own = [note for note in notes if note.startswith((f"{where} ", f"{where}."))]
    if where == "the scene":
        # Files that could not be opened come first. Notes on fabrics explain more than on lights.
        own = sorted(notes, key=lambda note: note.startswith("/") and "fabric" not in note)
    told = error.problem
    found = [note for note in own if note.removeprefix(where).strip().split(";")[0] not in told]
    if len(found) <= MOST_REASONS:
        return found
    more = f"and {len(found) - MOST_REASONS} more; 'fabricusd render -n' lists them"
    return [*found[:MOST_REASONS], more]

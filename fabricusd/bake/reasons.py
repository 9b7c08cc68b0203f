"""Refusals of a bake, with what the scene's reader had to say of their cause."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar

from fabricusd.errors import FabricError
from fabricusd.scene.scene import Scene

P = ParamSpec("P")
T = TypeVar("T")

MOST_REASONS = 3
"""Notes of the reader that a refusal repeats."""


def explained(
    make: Callable[Concatenate[Scene, P], T],
) -> Callable[Concatenate[Scene, P], T]:
    """A function of a scene whose refusals repeat the scene's notes on what they are about, a mesh
    or all; a scene without a mesh is refused."""

    @wraps(make)
    def made(scene: Scene, /, *args: P.args, **named: P.kwargs) -> T:
        try:
            if not scene.meshes:
                raise FabricError("the scene", "holds no mesh that could be baked")
            return make(scene, *args, **named)
        except FabricError as error:
            reasons = "".join(f"; {reason}" for reason in _reasons(error, scene.notes))
            if not reasons:
                raise
            raise FabricError(error.where, error.problem + reasons) from error

    return made


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

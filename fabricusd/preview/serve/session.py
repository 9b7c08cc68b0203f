"""What a served page may ask for: tables, other cloth, a path-traced picture, a variant saved."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fabricusd.appearance.weave.lookup import back_of
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.preview.lights import Lights
from fabricusd.preview.page.arrays import mesh_arrays
from fabricusd.preview.page.make import page_data, side_data
from fabricusd.preview.serve.opened import opened
from fabricusd.preview.serve.said import parsed, whole
from fabricusd.preview.serve.traced import VIEW, traced, view_of
from fabricusd.preview.serve.wanted import CHANGES, changed
from fabricusd.preview.shapes import SHAPES, Shape, swatch
from fabricusd.stop import Stop

MOST_OPEN = 32
"""Cloths that are held; those that were opened first are let go, but for the very first."""

LONGEST_NAME = 80
"""Characters of the name of a variant."""


class Session:
    """One user's cloths. All that takes time is done for one request after the other.

    fabric : the cloth of the page; mesh : the user's own; save : the one file that may be written
    """

    def __init__(
        self, fabric: Fabric, *, lights: Lights, mesh: Shape | None = None, save: Path | None = None
    ) -> None:
        self.lights, self.mesh, self.file = lights, mesh, save
        self.cloths: dict[int, Fabric] = {0: fabric}
        self.opened = 0
        self.saved: int | None = None
        self.stop = Stop()
        self._turn = threading.Lock()
        self.answers: Mapping[str, tuple[Mapping[str, type], Callable[[dict[str, Any]], Any]]] = {
            "/fabric": ({"cloth": int, "side": str, "first": bool, **CHANGES}, self._fabric),
            "/open": ({"name": str, "data": str}, self._open),
            "/render": ({"cloth": int, "side": str, "shape": str, **CHANGES, **VIEW}, self._render),
            "/save": ({"cloth": int, "variant": str, **CHANGES}, self._save),
        }

    def answer(self, path: str, body: bytes) -> dict[str, Any]:
        """The reply to a request; path : one of `answers`.

        Raises FabricError for a request that cannot be answered, and KeyboardInterrupt where the
        session ends meanwhile.
        """
        allowed, reply = self.answers[path]
        said = parsed(body, allowed)
        with self._turn:
            if self.stop.asked:
                raise KeyboardInterrupt
            found: dict[str, Any] = reply(said)
            return found

    def end(self, patience: float = 10.0) -> None:
        """Break off what is being computed, and wait for it for at most so many seconds."""
        self.stop.asked = True
        if self._turn.acquire(timeout=patience):
            self._turn.release()

    def _cloth(self, said: Mapping[str, Any]) -> Fabric:
        """The cloth that a request names, with its changes, from the side that it names."""
        at = whole("cloth", said.get("cloth", 0), 0, 2**31)
        if at not in self.cloths:
            raise FabricError("cloth", f"{at} is no longer open; drop its file again")
        fabric = changed(self.cloths[at], said)
        side = said.get("side", "front")
        if side not in ("front", "back"):
            raise FabricError("side", "is unknown; it must be front or back")
        return fabric if side == "front" else back_of(fabric)

    def _fabric(self, said: dict[str, Any]) -> dict[str, Any]:
        """Tables of a side of a cloth; with `first`, all that a page begins with."""
        fabric = self._cloth(said)
        if said.get("first"):
            return {**page_data(fabric, self.lights, self.mesh), **self._about()}
        back = said.get("side") == "back"
        # A mirrored back has the threads of the front.
        live = not back or self.cloths[said.get("cloth", 0)].back is None
        side = side_data(fabric, back=back, live=live)
        return {"side": side, "swatch": mesh_arrays(swatch(fabric))}

    def _about(self) -> dict[str, Any]:
        file = str(self.file.name) if self.file else ""
        return {"served": True, "file": file}

    def _open(self, said: dict[str, Any]) -> dict[str, Any]:
        fabric, notes = opened(said.get("name", ""), said.get("data", ""))
        data = page_data(fabric, self.lights, self.mesh)
        self.opened += 1
        self.cloths[self.opened] = fabric
        for old in sorted(self.cloths)[1 : len(self.cloths) - MOST_OPEN + 1]:
            del self.cloths[old]
        return {**data, **self._about(), "cloth": self.opened, "notes": list(notes)}

    def _render(self, said: dict[str, Any]) -> dict[str, Any]:
        view = view_of(said)
        fabric = self._cloth(said)
        name = said.get("shape", "cylinder")
        known = [*SHAPES, *(["scene"] if self.mesh is not None else [])]
        if name not in known:
            raise FabricError("shape", f"is unknown; it must be one of {', '.join(known)}")
        shape = self.mesh if name == "scene" else SHAPES[name](fabric)
        assert shape is not None
        return traced(fabric, shape, view, self.stop)

    def _save(self, said: dict[str, Any]) -> dict[str, Any]:
        from fabricusd.schema.edit.whole import save_variant

        if self.file is None:
            raise FabricError("/save", "has no file; start with --save FILE")
        at = said.get("cloth", 0)
        fabric = self._cloth({**said, "side": "front"})
        # A file that is there from the start is that of the first cloth.
        if self.file.exists() and at != (self.saved or 0):
            raise FabricError(
                self.file.name,
                "holds another cloth; serve the new one with a --save FILE of its own",
            )
        name = said.get("variant", "")
        if not 0 < len(name) <= LONGEST_NAME:
            raise FabricError("variant", f"is not a name of 1 to {LONGEST_NAME} letters")
        told = save_variant(self.file, name, fabric, self.cloths[at])
        self.saved = at
        return {"file": self.file.name, "variant": name, "set": list(told)}


def require_file(save: Path, source: str, scene: bool) -> None:
    """Raise FabricError now for a file that could not be saved to later.

    A file that exists must be the one that is served: its fabric gets the variants.
    """
    from fabricusd.files import require_writable
    from fabricusd.schema.write import EXTENSIONS

    if save.suffix.lower() not in EXTENSIONS:
        raise FabricError(str(save), f"is no name to save to; it must end in {EXTENSIONS[0]}")
    require_writable(save)
    if not save.exists():
        return
    if scene:
        raise FabricError(str(save), "exists; it must be a new name where a scene is served")
    if not (Path(source).exists() and save.samefile(source)):
        raise FabricError(
            str(save),
            f"exists and is not {source}; it must be a new name, or the file that is served",
        )

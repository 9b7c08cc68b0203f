"""The cloth as tubes: built once per fabric, asked by everything else in this room."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.scattering.model import CONSERVING
from fabricusd.appearance.scattering.models import model_of
from fabricusd.appearance.scattering.table import pack_threads
from fabricusd.appearance.weave.coverage import sets
from fabricusd.appearance.weave.curve import is_pile
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.geometry.lines import Repeat, repeat_lines
from fabricusd.geometry.mesh import Mesh, sweep
from fabricusd.geometry.pile import tuft_repeat
from fabricusd.geometry.uneven import uneven_lines
from fabricusd.reference.rays.embree import Accelerator

Floats = NDArray[np.float64]


class Patch(NamedTuple):
    """What a ray may cross before it has to be put back into the repeat [m].

    size : (2,) float - the repeat; low, high : (2,) float - rims of the patch of triangles, less
        the widest thread, which would be missing just beyond them; bottom, top : float
    """

    size: Floats
    low: Floats
    high: Floats
    bottom: float
    top: float


class Lines(NamedTuple):
    """The threads of the repeat as columns. Lengths in metres.

    which, kind, number : (l,) int32 - set, type, number in the set
    half_width, half_height : (l,) float - half axes of the section
    mean_width : (l,) float - its perimeter over pi: its width seen from all sides, on average
    """

    which: NDArray[np.int32]
    kind: NDArray[np.int32]
    number: NDArray[np.int32]
    half_width: Floats
    half_height: Floats
    mean_width: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Cloth:
    """One repeat of a fabric as swept elliptical tubes, without end in both directions.

    pitch : (2,) float - along U and V: from one end to the next, from one pick to the next [m]
    conserving : bool - whether every thread follows the conserving law: light then bounces, and
        leaves a thread in proportion to the width that the thread shows there. Otherwise light
        scatters once, and a thread is as bright as its model says.
    """

    fabric: Fabric
    repeat: Repeat
    mesh: Mesh
    patch: Patch
    lines: Lines
    threads: NDArray[Any]
    pitch: Floats
    conserving: bool
    accelerator: Accelerator

    @property
    def flatness(self) -> Floats:
        """(2,) height over width of the sections of the weft and of the warp."""
        found = np.zeros(2)
        for which in (WEFT, WARP):
            mine = self.lines.which == which
            if mine.any():
                ratio = self.lines.half_height[mine] / self.lines.half_width[mine]
                found[which] = ratio.mean()
        return found

    def with_fabric(self, fabric: Fabric) -> Cloth:
        """The same tubes of threads that scatter as those of `fabric`, whose layout is the same."""
        return replace(
            self,
            fabric=fabric,
            threads=pack_threads(fabric),
            conserving=_all_conserving(fabric),
        )


def tubes(fabric: Fabric, *, squash: float = 1.0, threads: tuple[int, int] | None = None) -> Cloth:
    """`fabric` as tubes that can be traced.

    squash : float, above 0 and up to 1 - the sections' greatest height, over the one that just fits
    threads : ends and picks of a patch of true threads, at least, whose tubes are as uneven as they
        are; the patch is rounded up to whole repeats, and repeated. None for one repeat of even
        threads

    Raises FabricError for cloth that has no such geometry: pile, curves that leave crossing threads
    no room, repeats too large.
    """
    if not 0.0 < squash <= 1.0:
        raise FabricError("squash", f"is {squash}; it must be above 0 and at most 1")
    piled = _is_pile(fabric)
    if piled and threads is not None:
        raise FabricError("threads", "is asked of pile; geometry takes even pile only")
    if piled:
        repeat, mesh = tuft_repeat(fabric, squash)
    else:
        repeat = repeat_lines(fabric, squash)
        if threads is not None:
            repeat = uneven_lines(fabric, repeat, threads)
    if not repeat.lines:
        raise FabricError(f"fabric '{fabric.name}'", "covers nothing; it must show some thread")
    top = max(float((ln.height + ln.half_height).max()) for ln in repeat.lines)
    bottom = min(float((ln.height - ln.half_height).min()) for ln in repeat.lines)
    if not piled:
        mesh = sweep(repeat, top - bottom)
    spare = 1e-3 * (top - bottom)
    widest = max(
        ln.half_width * (1.0 if ln.wider is None else float(ln.wider.max())) for ln in repeat.lines
    )
    pitch = np.array([s.pitch for s in sets(fabric)])
    return Cloth(
        fabric=fabric,
        repeat=repeat,
        mesh=mesh,
        patch=Patch(
            repeat.size,
            -mesh.rim + widest,
            repeat.size + mesh.rim - widest,
            bottom - spare,
            top + spare,
        ),
        lines=_columns(repeat),
        threads=pack_threads(fabric),
        pitch=pitch[[WARP, WEFT]],
        conserving=_all_conserving(fabric),
        accelerator=Accelerator(mesh.points, mesh.triangles),
    )


def _is_pile(fabric: Fabric) -> bool:
    """Whether `fabric` is tufts on a backing. Raises FabricError for pile of any other kind."""
    piled = [name for name, t in fabric.threads.items() if is_pile(t.curve)]
    if piled and not (fabric.opaque and len(piled) == len(fabric.threads)):
        raise FabricError(
            f"thread '{piled[0]}'",
            "is pile in a cloth that is not all pile on an opaque backing; geometry takes pile "
            "where every thread is pile and the fabric is opaque",
        )
    return bool(piled)


def _all_conserving(fabric: Fabric) -> bool:
    return all(model_of(fabric, t).law == CONSERVING for t in fabric.thread_list)


def _columns(repeat: Repeat) -> Lines:
    width = np.array([ln.half_width for ln in repeat.lines])
    height = np.array([ln.half_height for ln in repeat.lines])
    # Ramanujan's perimeter of an ellipse, within 1e-4 down to a tenth as high as wide.
    h = ((width - height) / (width + height)) ** 2
    mean = (width + height) * (1 + 3 * h / (10 + np.sqrt(4 - 3 * h)))
    which, kind, number = (
        np.array([getattr(ln, name) for ln in repeat.lines], np.int32)
        for name in ("which", "kind", "number")
    )
    return Lines(which, kind, number, width, height, mean)


__all__ = ["Cloth", "Lines", "Patch", "tubes"]

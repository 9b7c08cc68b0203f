"""Compile the weave of a fabric into contiguous arrays, which the lookup and the shadows read.

`compile_fabric` turns the frozen dataclasses of `fabricusd.fabric` into a `CompiledFabric`, once
per fabric and precision. Sets are indexed by WEFT and WARP of `coverage`, thread types by their
order in `Fabric.threads`, and the grid by `[end, pick]`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

import fabricusd.kernels  # noqa: F401 - chooses where kernels are cached
from fabricusd.appearance.weave.coverage import coverage, sets, true_repeat
from fabricusd.appearance.weave.curve import is_pile, pieces
from fabricusd.appearance.weave.sections import sections
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric

__all__ = ["CompiledFabric", "compile_fabric", "true_repeat"]

Reals = NDArray[Any]
"""float32 or float64: the precision that the fabric was compiled for."""


class CompiledFabric(NamedTuple):
    """Arrays and scalars of one fabric; `real` below is the precision asked for.

    grid : (m, n) uint8 - 1 where end i lies over pick j
    runs : (m, n, slots, 2) uint16, or uint32 beyond 65535 threads - place of the cell in the run of
        equal cells along the thread (cells from its start), and length of that run (cells; 0 for a
        run without end, whose places count from the border of the repeat); slot 0 is for the thread
        on top, slot 1 for the one underneath, present unless both sets fill their pitch
    sequence : (2, k) int32 - thread types of each set; k is the length of the longer sequence
    sequence_length : (2,) int64 - number of threads after which the types repeat
    width : (2,) real - share of its pitch that a thread of the set takes
    rim : (2,) real - what a thread of the set shows beyond the cells that it is on top in, at each
        end [cells]: half of what the crossing threads leave of their pitch
    area : (2, k) real - share of the cloth that type k of set j covers
    gap : real - share of the cloth that no thread covers
    pitch : (2,) real - distance from one thread of the set to the next [m]
    half_height : (2, k) real - half the height of a thread's section [m], see `sections`
    lift : (2,) real - height of the set's axes above that of their curves [m]; 0 for the warp
    curve_start : (k, p) real - start of each linear piece of a type's curve, in run lengths; padded
        with 2 to a power of two
    curve_angle, curve_slope : (k, p) real - angle at that start [rad], change of angle per run
        length
    curve_height : (k, p) real - height at that start, in run lengths
    pile : (k,) uint8 - 1 if the type's curve has no height field
    last, tiny : real - the largest number below 1, the smallest normal number
    """

    grid: NDArray[np.uint8]
    runs: NDArray[Any]
    sequence: NDArray[np.int32]
    sequence_length: NDArray[np.int64]
    width: Reals
    rim: Reals
    area: Reals
    gap: Any
    pitch: Reals
    half_height: Reals
    lift: Reals
    curve_start: Reals
    curve_angle: Reals
    curve_slope: Reals
    curve_height: Reals
    pile: NDArray[np.uint8]
    last: Any
    tiny: Any


def compile_fabric(
    fabric: Fabric,
    *,
    precision: type[np.floating[Any]] = np.float32,
) -> CompiledFabric:
    """Arrays of `fabric` in `precision`, np.float32 or np.float64."""
    if precision not in (np.float32, np.float64):
        raise FabricError("precision", f"is {precision!r}; it must be float32 or float64")
    real = precision

    def reals(x: Any) -> Reals:
        return np.ascontiguousarray(x, dtype=real)

    share = coverage(fabric)
    lengths = np.array([len(s.sequence) for s in sets(fabric)])
    sequence = np.zeros((2, lengths.max()), np.int32)
    for row, thread_set in zip(sequence, sets(fabric), strict=True):
        row[: len(thread_set.sequence)] = thread_set.sequence
    pitch = np.array([s.pitch for s in sets(fabric)])
    section = sections(fabric)
    return CompiledFabric(
        grid=np.ascontiguousarray(fabric.weave.cells, dtype=np.uint8),
        runs=_run_table(fabric.weave.cells, 2 if share.width.min() < 1.0 else 1),
        sequence=sequence,
        sequence_length=lengths,
        width=reals(share.width),
        rim=reals(0.5 * (1.0 - share.width[::-1])),
        area=reals(share.type_area),
        gap=real(share.gap),
        pitch=reals(pitch),
        half_height=reals(section.half_height),
        lift=reals((section.lift, 0.0)),
        **{name: reals(table) for name, table in _curve_tables(fabric).items()},
        pile=np.array([is_pile(t.curve) for t in fabric.thread_list], np.uint8),
        last=np.nextafter(real(1), real(0)),
        tiny=np.finfo(real).tiny,
    )


def _run_table(cells: NDArray[np.bool_], slots: int) -> NDArray[Any]:
    """`CompiledFabric.runs`: runs of the warp cross the picks, runs of the weft cross the ends.

    A run is a sequence of equal cells along a thread, whether the thread is on top or underneath,
    so one table per direction serves both slots.
    """
    kind: Any = np.uint16 if max(cells.shape) <= np.iinfo(np.uint16).max else np.uint32
    found = np.empty((*cells.shape, slots, 2), kind)
    cells = np.ascontiguousarray(cells)
    by_end = np.empty((*cells.shape, 2), kind)
    _fill_runs(cells, by_end)
    by_pick = np.empty((*cells.shape[::-1], 2), kind)
    _fill_runs(np.ascontiguousarray(cells.T), by_pick)
    _share_out(cells, by_end, by_pick, found)
    return found


@njit(cache=True)
def _share_out(cells, by_end, by_pick, out):
    """Combine runs along the warp (m, n, 2) and the weft (n, m, 2) into out (m, n, slots, 2)."""
    block = 64
    for i0 in range(0, cells.shape[0], block):
        for j0 in range(0, cells.shape[1], block):
            for i in range(i0, min(i0 + block, cells.shape[0])):
                for j in range(j0, min(j0 + block, cells.shape[1])):
                    for k in range(2):
                        if cells[i, j]:
                            out[i, j, 0, k] = by_end[i, j, k]
                            if out.shape[2] > 1:
                                out[i, j, 1, k] = by_pick[j, i, k]
                        else:
                            out[i, j, 0, k] = by_pick[j, i, k]
                            if out.shape[2] > 1:
                                out[i, j, 1, k] = by_end[i, j, k]


@njit(cache=True)
def _fill_runs(lines, out):
    """Compute place and length of the runs, out (r, n, 2), from `lines`: (r, n) cells of r threads.

    Runs wrap around the repeat. A run without end has length 0, and its places count from the
    border of the repeat.
    """
    n = lines.shape[1]
    for r in range(lines.shape[0]):
        # Start at the start of a run, so that the run that wraps around is met as a whole.
        first = 0
        while first < n and lines[r, first] == lines[r, first - 1]:
            first += 1
        start = 0 if first == n else first
        left = n
        while left > 0:
            count, k = 1, start + 1 if start + 1 < n else 0
            while count < left and lines[r, k] == lines[r, start]:
                count += 1
                k = k + 1 if k + 1 < n else 0
            for place in range(count):
                out[r, start, 0] = place
                out[r, start, 1] = 0 if first == n else count
                start = start + 1 if start + 1 < n else 0
            left -= count


def _curve_tables(fabric: Fabric) -> dict[str, NDArray[np.float64]]:
    """The linear pieces of every type's curve, padded to a power of two with unreachable starts."""
    found = [pieces(t.curve) for t in fabric.thread_list]
    longest = max(len(p.start) for p in found)
    shape = (len(found), 1 << (longest - 1).bit_length())
    start, angle = np.full(shape, 2.0), np.zeros(shape)
    slope, height = np.zeros(shape), np.zeros(shape)
    for row, (p, thread) in enumerate(zip(found, fabric.thread_list, strict=True)):
        used = slice(0, len(p.start))
        start[row, used], angle[row, used] = p.start, p.first
        slope[row, used] = (p.last - p.first) / p.length
        height[row, used] = 0.0 if is_pile(thread.curve) else p.height
    return {
        "curve_start": start,
        "curve_angle": angle,
        "curve_slope": slope,
        "curve_height": height,
    }

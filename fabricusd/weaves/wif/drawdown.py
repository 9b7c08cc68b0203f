"""The drawdown of a WIF draft, from threading and either tie-up and treadling or a lift plan.

The shafts that a pick raises are stored as bits, of which bit 0 stands for no shaft: a jacquard has
as many bits as crossings.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.weaves.draft import LIMIT
from fabricusd.weaves.wif.syntax import Section, Wif

Bits = NDArray[np.uint8]
Group = NDArray[np.int32]

_NONE = np.zeros(0, np.int32)

_BLOCK = 1024
"""Columns that are turned into rows at once; for the largest draft they take 16 MB."""


def drawdown(wif: Wif, ends: int, picks: int) -> NDArray[np.bool_]:
    """(ends, picks) bool, read-only, True where the warp is on top."""
    rising = wif.section("WEAVING").boolean("Rising Shed")
    if rising is None:
        wif.warn("[WEAVING] does not say whether the shed rises; it is taken to rise.")
    largest, hint = _stated(wif, "Shafts")
    threading = _groups(wif.section("THREADING"), ends, largest, hint)
    wif.warn_of_beyond("THREADING", ends, "end")
    if not any(map(len, threading)):
        raise FabricError(
            wif.section("THREADING").where(),
            "does not name any shaft; it must give each end at least one",
        )
    shafts = _largest(threading)
    raised = _raised(wif, picks, shafts, largest, hint)
    # The picks that raise an end are those that raise any of its shafts.
    by_end = _union(_turned(raised, shafts + 1), threading)
    up = np.unpackbits(by_end, axis=1, count=picks).view(np.bool_)
    if rising is False:
        np.logical_not(up, out=up)
    up.flags.writeable = False
    return up


def _raised(wif: Wif, picks: int, shafts: int, largest: int, hint: str) -> Bits:
    """(picks, bytes) bits of the shafts, from 0 to `shafts`, that each pick moves.

    They come from tie-up and treadling, which record the loom, and if those are missing from the
    lift plan: many programs write both.
    """
    tie_up, treadling, plan = (wif.section(n) for n in ("TIEUP", "TREADLING", "LIFTPLAN"))
    planned = any(True for _ in plan.numbers(1, picks))
    if not (tie_up.numbered and any(True for _ in treadling.numbers(1, picks))):
        if not planned:
            absent = treadling if tie_up.numbered else tie_up
            raise FabricError(
                absent.where(),
                "is missing; a draft must have [TIEUP] and [TREADLING], or a [LIFTPLAN]",
            )
        wif.warn_of_beyond("LIFTPLAN", picks, "pick")
        return _lifted(plan, picks, shafts, largest, hint)
    moved = _moved(wif, picks, shafts, largest, hint)
    if planned:
        try:
            same = np.array_equal(_lifted(plan, picks, shafts, largest, hint), moved)
        except FabricError as error:
            wif.warn(f"[LIFTPLAN] is not used, since there is a tie-up with a treadling: {error}.")
        else:
            if not same:
                wif.warn("[LIFTPLAN] differs from [TIEUP] and [TREADLING]; those two are used.")
    return moved


def _moved(wif: Wif, picks: int, shafts: int, largest: int, hint: str) -> Bits:
    """(picks, bytes) bits of the shafts that the treadles of each pick move."""
    tie_up, treadling = wif.section("TIEUP"), wif.section("TREADLING")
    treadles, why = _stated(wif, "Treadles")
    pressed = _groups(treadling, picks, treadles, why)
    wif.warn_of_beyond("TREADLING", picks, "pick")
    wif.warn_of_beyond("TIEUP", treadles, "treadle")
    ties = np.zeros((_largest(pressed) + 1, _bytes(shafts)), np.uint8)
    used = np.zeros(len(ties), np.bool_)
    for group in pressed:
        used[group] = True
    wrong: list[str] = []
    for number in tie_up.numbers(1, treadles):
        try:
            group = tie_up.list(number, largest, hint)
        except FabricError as error:
            if number < len(used) and used[number]:
                raise
            wrong.append(str(error))
        else:
            if number < len(ties):
                ties[number] = _bits(group, shafts)
    if wrong:
        wif.warn(f"{len(wrong)} treadle(s) are wrong, but no pick uses them: {wrong[0]}.")
    return _union(ties, pressed)


def _lifted(plan: Section, picks: int, shafts: int, largest: int, hint: str) -> Bits:
    """(picks, bytes) bits of the shafts that each line of the lift plan names."""
    lifted = np.zeros((picks, _bytes(shafts)), np.uint8)
    for number in plan.numbers(1, picks):
        lifted[number - 1] = _bits(plan.list(number, largest, hint), shafts)
    return lifted


def _stated(wif: Wif, key: str) -> tuple[int, str]:
    """The largest number of a shaft or treadle, and words for where that limit is stated."""
    stated = wif.section("WEAVING").integer(key, 0, LIMIT)
    return (stated, f", [WEAVING] {key}") if stated else (LIMIT, "")


def _groups(section: Section, count: int, largest: int, hint: str) -> list[Group]:
    """The numbers listed in lines 1 to `count` of `section`; none for a line that is missing."""
    groups = [_NONE] * count
    for number in section.numbers(1, count):
        groups[number - 1] = section.list(number, largest, hint)
    return groups


def _largest(groups: Sequence[Group]) -> int:
    return max((int(items.max()) for items in groups if len(items)), default=0)


def _bytes(shafts: int) -> int:
    """Bytes that hold the bits 0 to `shafts`."""
    return shafts // 8 + 1


def _bits(items: Group, shafts: int) -> Bits:
    """(bytes,) bits that are set for the numbers in `items` up to `shafts`."""
    row = np.zeros(shafts + 1, np.bool_)
    row[items[items <= shafts]] = True
    return np.packbits(row)


def _union(bits: Bits, groups: Sequence[Group]) -> Bits:
    """(len(groups), w) uint8: for each group, the bitwise or of the rows of `bits` it names."""
    union = np.zeros((len(groups), bits.shape[1]), np.uint8)
    for row, items in zip(union, groups, strict=True):
        if len(items) == 1:
            row[:] = bits[items[0]]
        elif len(items):
            np.bitwise_or.reduce(bits[np.unique(items)], axis=0, out=row)
    return union


def _turned(bits: Bits, columns: int) -> Bits:
    """(columns, bytes) bits, transposed from rows of at least `columns` bits."""
    turned = np.zeros((columns, (len(bits) + 7) // 8), np.uint8)
    for start in range(0, columns, _BLOCK):
        end = min(start + _BLOCK, columns)
        block = np.unpackbits(bits[:, start // 8 : (end + 7) // 8], axis=1, count=end - start)
        turned[start:end] = np.packbits(block.T, axis=1)
    return turned

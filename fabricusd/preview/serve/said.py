"""What a request says, checked: JSON of a few kinds, numbers in range, grids of bounded size."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from fabricusd.errors import FabricError, one_line


def parsed(body: bytes, allowed: Mapping[str, type]) -> dict[str, Any]:
    """The object in a request's body. allowed : name -> kind of its value; any may be left out.

    Raises FabricError for anything else.
    """
    try:
        found = json.loads(body.decode("utf-8"), parse_constant=_refuse)
        # Half of a pair of surrogates is no text, and no name of a file.
        json.dumps(found, ensure_ascii=False).encode("utf-8")
    except (ValueError, RecursionError) as error:
        raise FabricError("the request", f"is not JSON: {one_line(str(error), 80)}") from None
    if not isinstance(found, dict):
        raise FabricError("the request", "is no JSON object; it must be one")
    for name, value in found.items():
        if name not in allowed:
            known = ", ".join(allowed)
            raise FabricError(
                f"'{one_line(name, 40)}'", f"is not known here; it must be one of {known}"
            )
        kind = allowed[name]
        fits = isinstance(value, int | float) if kind is float else isinstance(value, kind)
        if not fits or (isinstance(value, bool) and kind is not bool):
            raise FabricError(name, f"is of another kind than {_WORDS[kind]}")
    return found


_WORDS = {
    str: "a text", float: "a number", int: "a whole number", list: "a list", dict: "an object",
    bool: "true or false",
}  # fmt: skip


def _refuse(word: str) -> float:
    raise ValueError(f"{word} is no number")


def number(where: str, value: Any, low: float, high: float) -> float:
    """`value`, if it is a finite number in range; FabricError otherwise."""
    fits = isinstance(value, int | float) and not isinstance(value, bool)
    # NaN is in no range, and infinity is beyond all of them.
    if not fits or not low <= value <= high:
        raise FabricError(where, f"is not a number from {low:g} to {high:g}")
    return float(value)


def whole(where: str, value: Any, low: int, high: int) -> int:
    """`value`, if it is a whole number in range; FabricError otherwise."""
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise FabricError(where, f"is not a whole number from {low} to {high}")
    return value


def numbers(where: str, value: Any, count: int, low: float, high: float) -> list[float]:
    """`value`, if it is a list of so many numbers in range; FabricError otherwise."""
    if not isinstance(value, list) or len(value) != count:
        raise FabricError(where, f"is not a list of {count} numbers")
    return [number(where, one, low, high) for one in value]

"""Values of attributes from what a person types."""

from __future__ import annotations

import math
from typing import Any

from pxr import Gf, Sdf, Vt

from fabricusd.errors import FabricError
from fabricusd.weaves.color import parse_color
from fabricusd.weaves.draft import quoted

TRUE, FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")


def value_of(text: str, spec: Sdf.AttributeSpec, where: str) -> Any:
    """`text` as a value of the attribute that `spec` defines, in the file's unit.

    Colours are #rrggbb or three linear numbers. Raises FabricError, naming `where`, for anything
    that is not such a value.
    """
    kind = str(spec.typeName)
    if kind.startswith("color"):
        return Gf.Vec3d(*parse_color(text, where))
    if kind == "double":
        return _numbers(text, 1, where)[0]
    if kind == "double2":
        return Gf.Vec2d(*_numbers(text, 2, where))
    if kind == "double[]":
        return Vt.DoubleArray(_numbers(text, None, where))
    if kind == "int[]":
        numbers = _numbers(text, None, where)
        if any(number != int(number) for number in numbers):
            raise FabricError(
                where, f"is {quoted(text, 40)}; it must be whole numbers, as in 0,1,1"
            )
        return Vt.IntArray([int(number) for number in numbers])
    if kind == "bool":
        return _truth(text, where)
    if kind == "string[]":
        return Vt.StringArray([part.strip() for part in text.split(",")])
    return text.strip()


def _numbers(text: str, count: int | None, where: str) -> list[float]:
    """Numbers that commas separate; `count` of them, or any number."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = [math.nan]
    if not all(math.isfinite(x) and abs(x) < 1e9 for x in numbers) or len(numbers) != (
        count or len(numbers)
    ):
        accepted = {1: "a number", 2: "two numbers, as in 0.5,0.5"}.get(
            count or 0, "numbers, as in 0,0.5,1"
        )
        raise FabricError(where, f"is {quoted(text, 40)}; it must be {accepted}")
    return numbers


def _truth(text: str, where: str) -> bool:
    word = text.strip().lower()
    if word not in TRUE + FALSE:
        raise FabricError(where, f"is {quoted(text, 40)}; it must be true or false")
    return word in TRUE

"""What an expression of a kernel is while it is translated: its GLSL, its type, its value if known.

Types are FLOAT, INT, BOOL, NamedTuple classes (structs), and what has no GLSL of its own: `Group`,
a tuple of tables, `Table`, one of its arrays, `Row`, a row of an array, `Shape`, and REAL, the
precision that kernels take first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

FLOAT, INT, BOOL, REAL = "float", "int", "bool", "R"


@dataclass(frozen=True)
class Group:
    """A named tuple of tables, such as the published law's."""

    name: str


@dataclass(frozen=True)
class Table:
    """An array. dimensions : its number of indices; kind : FLOAT, INT, or "byte"."""

    name: str
    dimensions: int
    kind: str


@dataclass(frozen=True)
class Row:
    """A row of a two-dimensional array; its GLSL is the row's number."""

    table: Table


@dataclass(frozen=True)
class Shape:
    """The shape of an array."""

    table: Table


@dataclass(frozen=True)
class Several:
    """A tuple of values, each of a type."""

    types: tuple[Any, ...]


@dataclass(frozen=True)
class Value:
    """An expression. known : whether `value` is its value at translation."""

    code: str
    type: Any
    value: Any = None
    known: bool = False


def constant(value: Any) -> Value:
    """A number or a truth value as an expression."""
    if isinstance(value, bool):
        return Value("true" if value else "false", BOOL, value, True)
    if isinstance(value, int):
        return Value(str(value), INT, value, True)
    number = float(value)
    if number != number:
        return Value("intBitsToFloat(0x7fc00000)", FLOAT)
    return Value(repr(number), FLOAT, number, True)


def as_type(value: Value, kind: Any) -> str:
    """The GLSL of `value` as a float, an int or a bool."""
    if value.type == kind:
        return value.code
    if kind == FLOAT and value.type == INT:
        return f"{value.code}.0" if value.known and value.value >= 0 else f"float({value.code})"
    if kind == INT and value.type in (FLOAT, BOOL):
        return f"int({value.code})"
    if kind == FLOAT and value.type == BOOL:
        return f"({value.code} ? 1.0 : 0.0)"
    raise NotImplementedError(f"{value} as {kind}")

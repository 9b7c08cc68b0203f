"""Attribute values of the type that the schema gives them; others are noted and not used.

USD hands out whatever a file holds, also a path or a word where the schema has numbers.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray
from pxr import Sdf, Tf, Usd, Vt

from fabricusd.errors import one_line
from fabricusd.scene.scene import Scene

_WORDS = (Vt.TokenArray, Vt.StringArray)


def value_of(attribute: Usd.Attribute, time: Usd.TimeCode, scene: Scene) -> Any:
    """The value of `attribute` at `time`; None where it is missing or has none.

    A value of another type gets a note, and the schema's fallback is returned in its place.
    """
    value = attribute.Get(time) if attribute else None
    problem = type_problem(attribute, value)
    if not problem:
        return value
    fallback = _fallback(attribute)
    taken = "it is left out" if fallback is None else f"{_words(fallback)} is taken"
    scene.note(str(attribute.GetPath()), f"{problem}; {taken}")
    return fallback


def note_types(prim: Usd.Prim, names: str, time: Usd.TimeCode, scene: Scene) -> None:
    """Note the authored attributes of a wrong type among those that USD reads by itself.

    names : pattern of their names
    """
    for attribute in prim.GetAuthoredAttributes():
        if re.fullmatch(names, attribute.GetName()):
            value_of(attribute, time, scene)


def usd_words(error: Tf.ErrorException) -> str:
    """What USD found wrong, on one line, without the places in its source."""
    told = [str(one.commentary) for one in error.args if hasattr(one, "commentary")]
    return one_line("; ".join(told) or str(error), 200)


def type_problem(attribute: Usd.Attribute, value: Any) -> str:
    """`is of type T; it must be U` for a value of `attribute` that is; an empty string if sound."""
    if value is None:
        return ""
    wanted = attribute.GetTypeName()
    if _fits(value, wanted.defaultValue, is_array=wanted.isArray):
        return ""
    given = "a path" if isinstance(value, Sdf.Path) else f"of type {_type_name(value)}"
    return f"is {given}; it must be {wanted}"


def array_of(
    attribute: Usd.Attribute,
    time: Usd.TimeCode,
    scene: Scene,
    dtype: DTypeLike = np.float64,
    width: int = 0,
) -> NDArray[Any]:
    """(n,) or (n, width) numbers of an array attribute; none where it is missing or mistyped."""
    value = value_of(attribute, time, scene)
    numbers = np.array([] if value is None else value, dtype)
    return numbers.reshape(-1, width) if width else numbers


def _fits(value: Any, default: Any, *, is_array: bool) -> bool:
    """Whether `value` can be used where `default`'s type is asked for: numbers of another precision
    and whole numbers for real ones can."""
    if default is None or type(value) is type(default):
        return True
    if isinstance(default, _WORDS):
        return isinstance(value, _WORDS)
    if isinstance(default, bool | str) or isinstance(value, bool | str):
        return False
    given, wanted = np.asarray(value), np.asarray(default)
    if given.ndim != wanted.ndim or given.shape[is_array:] != wanted.shape[is_array:]:
        return False
    kinds = {"f": "fiu", "i": "iu", "u": "iu"}.get(wanted.dtype.kind, "")
    return given.dtype.kind in kinds and isinstance(value, int | float) == (given.ndim == 0)


def _type_name(value: Any) -> str:
    return str(Sdf.GetValueTypeNameForValue(value)) or type(value).__name__


def _fallback(attribute: Usd.Attribute) -> Any:
    """The schema's value for an attribute; None where it has none."""
    definition = attribute.GetPrim().GetPrimDefinition()
    name = attribute.GetName()
    if name not in definition.GetPropertyNames():
        return None
    return definition.GetAttributeFallbackValue(name)


def _words(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)

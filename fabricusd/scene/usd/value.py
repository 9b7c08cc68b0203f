"""Reads attribute values, and refuses those whose type is not the one of the schema.

USD returns whatever a file holds, even a path or a word where the schema has numbers.
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
    """The value of `attribute` at `time`; None where the attribute or its value is missing.

    For a value of another type a note is made, and the schema's fallback is returned.
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
    """Note authored attributes of a wrong type that USD's own functions read.

    names : regular expression of the attributes' names
    """
    for attribute in prim.GetAuthoredAttributes():
        if re.fullmatch(names, attribute.GetName()):
            value_of(attribute, time, scene)


def usd_words(error: Tf.ErrorException) -> str:
    """USD's error message on one line, without locations in USD's source code."""
    told = [str(one.commentary) for one in error.args if hasattr(one, "commentary")]
    return one_line("; ".join(told) or str(error), 200)


def type_problem(attribute: Usd.Attribute, value: Any) -> str:
    """`is of type T; it must be U` for a value of a wrong type, or an empty string."""
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
    """(n,) or (n, width) numbers of an array attribute; empty where it is missing or mistyped."""
    value = value_of(attribute, time, scene)
    numbers = np.array([] if value is None else value, dtype)
    return numbers.reshape(-1, width) if width else numbers


def _fits(value: Any, default: Any, *, is_array: bool) -> bool:
    """Whether `value` can stand where the type of `default` is asked for. A number of another
    precision can, and an integer can stand for a real number."""
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
    """The schema's fallback for an attribute; None where there is none."""
    definition = attribute.GetPrim().GetPrimDefinition()
    name = attribute.GetName()
    if name not in definition.GetPropertyNames():
        return None
    return definition.GetAttributeFallbackValue(name)


def _words(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)

"""Finds and loads the Embree 4 library of the embreex wheel, and declares its C functions."""

from __future__ import annotations

import ctypes
import glob
import importlib.util
import os
from functools import cache
from typing import Any


def _find_library() -> str | None:
    """The path of the Embree 4 library in the embreex wheel, or None."""
    if os.environ.get("FABRICUSD_EMBREE") == "python":
        return None
    spec = importlib.util.find_spec("embreex")
    if spec is None or spec.origin is None:
        return None
    package = os.path.dirname(spec.origin)
    for pattern in (
        os.path.join(os.path.dirname(package), "embreex.libs", "libembree4*"),
        os.path.join(os.path.dirname(package), "embreex.libs", "embree4*.dll"),
        os.path.join(package, ".dylibs", "libembree4*"),
    ):
        found = sorted(glob.glob(pattern))
        if found:
            return found[0]
    return None


def declare(library: ctypes.CDLL, functions: tuple[tuple[Any, ...], ...]) -> None:
    """Declare the types of the library's functions, each given as (name, result, *arguments)."""
    for name, result, *arguments in functions:
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments


def _declare_scene(library: ctypes.CDLL) -> None:
    """Declare the types of the functions that build a scene."""
    pointer, size, unsigned = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_uint
    declare(library, (
        ("rtcNewDevice", pointer, ctypes.c_char_p),
        ("rtcNewScene", pointer, pointer),
        ("rtcNewGeometry", pointer, pointer, ctypes.c_int),
        ("rtcSetSharedGeometryBuffer", None, pointer, ctypes.c_int, unsigned, ctypes.c_int,
         pointer, size, size, size),
        ("rtcCommitGeometry", None, pointer),
        ("rtcReleaseGeometry", None, pointer),
        ("rtcAttachGeometry", unsigned, pointer, pointer),
        ("rtcSetSceneFlags", None, pointer, ctypes.c_int),
        ("rtcCommitScene", None, pointer),
        ("rtcReleaseScene", None, pointer),
        ("rtcReleaseDevice", None, pointer),
        ("rtcGetDeviceProperty", ctypes.c_ssize_t, pointer, ctypes.c_int),
        ("rtcGetDeviceError", ctypes.c_int, pointer),
        ("rtcSetGeometryInstancedScene", None, pointer, pointer),
    ))  # fmt: skip


PATH = _find_library()


@cache
def library() -> ctypes.CDLL | None:
    """Embree's C library, or None if only embreex's Python interface can be used."""
    if PATH is None:
        return None
    try:
        found = ctypes.CDLL(PATH)
        _declare_scene(found)
    except (OSError, AttributeError):
        return None
    return found

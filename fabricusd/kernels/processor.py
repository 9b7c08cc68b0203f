"""Compile kernels for one of two levels of x86-64, instead of for the very processor at hand.

The levels are those of the x86-64 psABI: v3 has AVX2 and fused multiply-add, v4 the five parts of
AVX-512 that Intel and AMD share. A level is as fast as the processor's own name (decision 029), and
processors of one level can share compiled kernels: over a farm's file system, or in a package
(`kernels/ready.py`). At level v4 LLVM keeps to vectors of 256 bits, to spare other programs the
lower clock that wide vectors cost on the first such processors. Kernels here are loops of
arithmetic and little else, so wide vectors are asked for (decision 027).
"""

from __future__ import annotations

from typing import NamedTuple

import llvmlite.binding as llvm
import numba


class Level(NamedTuple):
    """What LLVM compiles for.

    name : LLVM's name of the level
    features : on top of those of the level
    needs : the features that a processor of this level has
    """

    name: str
    features: str
    needs: frozenset[str]


_V3 = frozenset({
    "avx", "avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sahf",
    "sse4.1", "sse4.2", "xsave",
})  # fmt: skip
_V4 = _V3 | {"avx512bw", "avx512cd", "avx512dq", "avx512f", "avx512vl"}

LEVELS = (
    Level("x86-64-v4", "-prefer-256-bit", _V4),
    Level("x86-64-v3", "", _V3),
)
"""The levels, the best first."""


def level_of(features: str) -> Level | None:
    """The best level of a processor, by LLVM's list of its features; None for one of neither
    level, for which numba compiles as it does by itself."""
    has = {feature[1:] for feature in features.split(",") if feature.startswith("+")}
    return next((level for level in LEVELS if level.needs <= has), None)


def choose_level() -> None:
    """Compile for the best level, unless NUMBA_CPU_NAME or NUMBA_CPU_FEATURES says otherwise."""
    if numba.config.CPU_NAME is not None or numba.config.CPU_FEATURES is not None:
        return
    level = level_of(llvm.get_host_cpu_features().flatten())
    if level is not None:
        numba.config.CPU_NAME, numba.config.CPU_FEATURES = level.name, level.features

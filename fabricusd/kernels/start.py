"""Start numba faster, by skipping three pieces of work that it does before its first kernel, and
let kernels begin their arrays where vector registers load whole lines of the cache."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from functools import partial
from typing import Any

from fabricusd.kernels.internals import use_internals

CACHE_LINE = 64
"""Bytes that kernels' arrays are aligned to."""

if use_internals():
    with suppress(ImportError):
        # Import this before the modules that overload indexing. numba tries the overloads in the
        # order of import, and arrays, which nearly every indexing in a kernel refers to, would
        # otherwise come after seven kinds of strings and lists. That order costs a fifth of the
        # whole compile time.
        import numba.core.typing.arraydecl  # noqa: F401
    with suppress(ImportError, AttributeError):
        from fabricusd.kernels.damaged_cache import forgive_damage

        forgive_damage()
    with suppress(ImportError, AttributeError):
        from numba.core.base import BaseContext

        # numba's own 32 bytes let half of all 64-byte vectors of a block straddle two lines: level
        # `weave` is 1.06 times as fast without them.
        if BaseContext.get_preferred_array_alignment:
            BaseContext.get_preferred_array_alignment = lambda context, kind: CACHE_LINE


def load_without_blas() -> None:
    """Load numba's array functions without scipy's linear algebra.

    numba imports scipy's linear algebra to learn whether it is installed, which takes a tenth of
    the time of a picture. No kernel here calls it; code that does makes numba check again.
    """
    if not use_internals():
        return
    try:
        from numba.np import linalg

        check = linalg.ensure_blas
    except (ImportError, AttributeError):
        return
    linalg.ensure_blas = lambda: None
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        linalg.ensure_blas = check


def load_as_they_are(kernels: Iterable[Any]) -> None:
    """Let cached kernels be loaded without the modules that only compilation needs.

    Before it loads a kernel, numba imports and registers everything that it can compile, which
    takes a tenth of the time of a picture. If a kernel is not cached, the compiler imports and
    registers these things itself.
    """
    if not use_internals():
        return
    try:
        from numba.core.caching import FunctionCache
        from numba.core.runtime import rtsys
    except ImportError:
        return
    for kernel in kernels:
        cache = getattr(kernel, "_cache", None)
        if isinstance(cache, FunctionCache):
            # Kernels that allocate arrays call the reference-counting functions by name.
            rtsys.initialize(kernel.targetctx)
            cache.load_overload = partial(_load, cache)


def _load(cache: Any, signature: Any, context: Any) -> Any:
    """`FunctionCache.load_overload` without its first line, which refreshes `context`."""
    with cache._guard_against_spurious_io_errors():
        return cache._load_overload(signature, context)

"""What numba loads before its first kernel, without three things that only cost time."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from functools import partial
from typing import Any

from fabricusd.kernels.internals import use_internals

if use_internals():
    with suppress(ImportError):
        # Before the modules that overload indexing: numba asks in the order of import, and arrays,
        # which nearly every index of a kernel is of, would otherwise come after seven kinds of
        # strings and lists. That order is a fifth of all the time it takes to compile.
        import numba.core.typing.arraydecl  # noqa: F401
    with suppress(ImportError, AttributeError):
        from fabricusd.kernels.damaged_cache import forgive_damage

        forgive_damage()


def load_without_blas() -> None:
    """Load numba's array functions without the linear algebra of scipy.

    To learn whether it is there, numba imports it: a tenth of the time that a picture takes. Code
    that calls it, ours does not, looks again.
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
    """Let kernels that numba has on disk be loaded without what only compiling needs.

    numba first imports and registers all that it knows how to compile: a tenth of the time that a
    picture takes. Where nothing is on disk the compiler does so by itself.
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
            # For reference counts, which kernels that allocate arrays call by name.
            rtsys.initialize(kernel.targetctx)
            cache.load_overload = partial(_load, cache)


def _load(cache: Any, signature: Any, context: Any) -> Any:
    """`FunctionCache.load_overload` after its first line, which refreshes `context`."""
    with cache._guard_against_spurious_io_errors():
        return cache._load_overload(signature, context)

"""One thread for NumPy's and SciPy's linear algebra, which with more adds in another order."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from threadpoolctl import threadpool_limits

_lock = threading.Lock()
_held: list[Any] = []
"""The limit, once for every context that is open; the last one takes it away."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """A context, or a decorator, in which results do not depend on the number of processors.

    A search that ends in a flat valley makes visible differences of last bits. The matrices of fits
    are small, so that more threads gain little. The limit holds for the whole process until all
    contexts have ended.
    """
    with _lock:
        _held.append(_held[0] if _held else threadpool_limits(1, "blas"))
    try:
        yield
    finally:
        with _lock:
            limit = _held.pop()
            if not _held:
                limit.restore_original_limits()

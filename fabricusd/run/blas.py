"""One thread for NumPy's and SciPy's linear algebra, which with more adds in another order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """A context, or a decorator, in which results do not depend on the number of processors.

    A search that ends in a flat valley makes visible differences of last bits. The matrices of fits
    are small, so that more threads gain little. The limit holds for the whole process meanwhile.
    """
    with threadpool_limits(1, "blas"):
        yield

"""What numba loads before its first kernel, without two things that only cost time."""

from __future__ import annotations

# Before the modules that overload indexing: numba asks in the order of import, and arrays, which
# nearly every index of a kernel is of, would otherwise come after seven kinds of strings and lists.
# That order is a fifth of all the time it takes to compile.
import numba.core.typing.arraydecl  # noqa: F401


def load_without_blas() -> None:
    """Load numba's array functions without the linear algebra of scipy.

    To learn whether it is there, numba imports it: a tenth of the time that a picture takes. Code
    that calls it, ours does not, looks again.
    """
    from numba.np import linalg

    check = linalg.ensure_blas
    linalg.ensure_blas = lambda: None
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        linalg.ensure_blas = check

"""Calls kernels over and over without asking numba each time which version fits the arguments.

numba looks at the type of every argument, and of every field of a tuple, whenever a kernel is
called: 5 us for the tuples of arrays of a stage of the path tracer, four times as long as the call
itself takes. All that time the thread holds the interpreter's lock, so that other workers wait.
"""

from __future__ import annotations

from typing import Any


class Calls:
    """Kernels and the version of each that its first call chose.

    Every later call of a kernel through the same object must have arguments of the same types, and
    arrays that lie in memory alike: nothing tests it, and a kernel would read the wrong numbers.
    Where that does not hold, use an object for each kind of arguments, or call the kernel itself.

    tested : for tests - whether each call is tested, and another type raises `TypeError`
    """

    tested = False

    def __init__(self) -> None:
        self._chosen: dict[Any, tuple[Any, Any]] = {}

    def __call__(self, kernel: Any, *arguments: Any) -> Any:
        """What `kernel(*arguments)` returns."""
        chosen = self._chosen.get(kernel)
        if chosen is None:
            chosen = self._chosen[kernel] = _choose(kernel, arguments)
        if Calls.tested and chosen[1] is not None:
            found = _types(kernel, arguments)
            if found != chosen[1]:
                raise TypeError(f"{kernel.__name__} was called with {chosen[1]}, now with {found}")
        return chosen[0](*arguments)


def _choose(kernel: Any, arguments: tuple[Any, ...]) -> tuple[Any, Any]:
    """The compiled version for these arguments, and their types; the kernel itself, and None, where
    numba does not compile."""
    if not hasattr(kernel, "overloads"):
        return kernel, None
    types = _types(kernel, arguments)
    kernel.compile(types)
    return kernel.overloads[types].entry_point, types


def _types(kernel: Any, arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(kernel.typeof_pyval(one) for one in arguments)

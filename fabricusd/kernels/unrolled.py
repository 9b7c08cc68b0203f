"""Generate functions on tuples of a known length, written out entry by entry.

numba can only build a tuple whose entries are spelled out. Here the source is generated from the
number of entries, so that nobody has to count them by hand.
"""

from __future__ import annotations

from typing import Any

from numba import njit

from fabricusd.kernels.real import INLINE


def tuple_reader(count: int, stride: int = 1) -> Any:
    """A kernel `read(numbers, first)`: a tuple of `count` entries from `first` on, `stride` apart.

    Use it for constants that a loop reads. If the loop loaded them from an array, LLVM would have
    to assume that every store into another array may change them.
    """
    entries = (f"numbers[first + {k * stride}]" for k in range(count))
    return _kernel("numbers, first", f"({', '.join(entries)},)")


def tuple_of(entry: Any, count: int) -> Any:
    """A kernel `make(R, *rest)`: the tuple of `entry(R, k, *rest)` for k from 0 to `count` - 1."""
    entries = (f"entry(R, {k}, *rest)" for k in range(count))
    return _kernel("R, *rest", f"({', '.join(entries)},)", entry=entry)


def sum_of_products(count: int) -> Any:
    """A kernel `total(a, b)`: the sum of a[k] b[k] over two tuples of `count` numbers."""
    return _kernel("a, b", " + ".join(f"a[{k}] * b[{k}]" for k in range(count)))


def tuple_writer(count: int, stride: int = 1) -> Any:
    """A kernel `write(numbers, first, values)`, the inverse of `tuple_reader`'s."""
    targets = ", ".join(f"numbers[first + {k * stride}]" for k in range(count))
    values = ", ".join(f"values[{k}]" for k in range(count))
    return _compiled("numbers, first, values", f"{targets} = {values}")


def _kernel(arguments: str, value: str, **names: Any) -> Any:
    return _compiled(arguments, f"return {value}", **names)


def _compiled(arguments: str, body: str, **names: Any) -> Any:
    made: dict[str, Any] = {"__name__": __name__, **names}
    exec(f"def written_out({arguments}):\n    {body}", made)
    return njit(**INLINE)(made["written_out"])

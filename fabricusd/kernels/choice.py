"""One kernel of several, chosen by a number: chains of comparisons that cost nothing in a loop.

numba calls through a table of functions slowly, and does not compile such a call into its caller.
A chain of functions compiled in place is as good as `if`s written by hand: where the number is a
constant LLVM folds the comparisons, elsewhere they are well predicted. The functions made here are
parts of kernels (`real.INLINE`), which are kept on disk with the kernels around them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from numba import njit

from fabricusd.kernels.real import INLINE


def by_number(functions: Mapping[int, Any]) -> Any:
    """A kernel `chosen(R, number, *rest)` that returns `functions[number](R, *rest)`.

    All functions take and return the same types. A function that has several numbers is compiled
    once, the one that has the most without a comparison: no number may be asked for that is not
    among `functions`.
    """
    numbers: dict[Any, list[int]] = {}
    for number, function in functions.items():
        numbers.setdefault(function, []).append(number)
    *others, last = sorted(numbers, key=lambda function: len(numbers[function]))
    chain = _always(last)
    for function in reversed(others):
        for number in numbers[function]:
            chain = _link(number, function, chain)
    return chain


def specialised(body: Any, numbers: Iterable[int]) -> Any:
    """A kernel `chosen(R, number, *rest)`: `body(R, number, *rest)` with `number` constant.

    For a body with a loop: each number gets a loop of its own, in which nothing asks for it.
    """
    return by_number({number: _bound(body, number) for number in numbers})


def for_each(body: Any, numbers: Iterable[int]) -> Any:
    """A kernel `run(R, *rest)`: `body(R, number, *rest)` for all numbers in turn, each constant."""
    chain = _nothing
    for number in reversed(tuple(numbers)):
        chain = _then(_bound(body, number), chain)
    return chain


@njit(**INLINE)
def _nothing(R, *rest):
    pass


def _always(function: Any) -> Any:
    @njit(**INLINE)
    def always(R, number, *rest):
        return function(R, *rest)

    return always


def _link(ours: int, function: Any, otherwise: Any) -> Any:
    @njit(**INLINE)
    def link(R, number, *rest):
        if number == ours:
            return function(R, *rest)
        return otherwise(R, number, *rest)

    return link


def _bound(body: Any, number: int) -> Any:
    @njit(**INLINE)
    def bound(R, *rest):
        return body(R, number, *rest)

    return bound


def _then(first: Any, following: Any) -> Any:
    @njit(**INLINE)
    def then(R, *rest):
        first(R, *rest)
        following(R, *rest)

    return then

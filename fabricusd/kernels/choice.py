"""Select one of several kernels by a number, with comparisons that cost nothing inside a loop.

Calls through a table of functions are slow in numba and are not inlined into the caller. A chain of
inlined functions is as fast as hand-written `if`s: where the number is a constant, LLVM folds the
comparisons; elsewhere the processor predicts them well. The functions made here are parts of
kernels (`real.INLINE`) and are cached on disk together with the kernels that call them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from numba import njit
from numba.extending import overload

from fabricusd.kernels.real import INLINE

_CHOSEN = {k: v for k, v in INLINE.items() if k != "cache"}


def by_number(functions: Mapping[int, Any]) -> Any:
    """A kernel `chosen(R, number, *rest)` that returns `functions[number](R, *rest)`.

    All functions take and return the same types. A function with several numbers is compiled once.
    The function with the most numbers comes last and is reached without a comparison, so `number`
    must be one of the keys of `functions`.
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
    """A kernel `chosen(R, number, *rest)` that calls `body` with `number` as a constant.

    Use it for a body with a loop: each number gets a loop of its own, without a test of the number
    inside.
    """
    return by_number({number: _bound(body, number) for number in numbers})


def for_each(body: Any, numbers: Iterable[int]) -> Any:
    """A kernel `run(R, *rest)` that calls `body(R, number, *rest)` for each number in turn, as a
    constant."""
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


def by_type(select: Any) -> Any:
    """A kernel `chosen(R, table, *rest)` that calls `select(type(table))(R, table, *rest)`.

    table : an instance of a NamedTuple class, which `select` maps to a kernel. The choice is made
    when the caller is compiled: kernels for one class contain no code for the others.
    """

    def chosen(R, table, *rest):  # type: ignore[no-untyped-def]
        raise NotImplementedError("called by kernels only")

    @overload(chosen, jit_options=_CHOSEN)
    def _choose(R, table, *rest):  # type: ignore[no-untyped-def]
        function = select(table.instance_class)

        def call(R, table, *rest):  # type: ignore[no-untyped-def]
            return function(R, table, *rest)

        return call

    return chosen

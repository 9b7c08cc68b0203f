"""Weaves written as an expression in the end `i` and the pick `j`. [Bisker2011] section 5.2.2.

    mod(i + j, 2) == 0                          plain
    mod(2*i + j, 5) != 0                        satin of 5, step 2
    mod(i + j, 4) < 2 and not mod(i, 8) == 0    comparisons joined by and, or, not
    shift(E, di, dj)                            E moved by di ends and dj picks
    scale(E, si, sj)                            each cell of E repeated si x sj times

True means that the warp is on top. `mod` is never negative; `i` and `j` count from 0. The repeat
follows from the numbers. Nothing is executed: the text is parsed into a syntax tree, in which only
the forms above are accepted.
"""

from __future__ import annotations

import ast
import functools
import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.fabric import Weave
from fabricusd.weaves.draft import Draft, quoted
from fabricusd.weaves.recognise import recognise

LARGEST = 4096
"""Most threads in a repeat, each way."""

LONGEST = 1000
"""Most characters in an expression."""

DEEPEST = 50
"""Most levels of nesting, well below the depth at which Python's own stack overflows."""

MOST_TERMS = 32
"""Most comparisons and calls; each costs one pass over the repeat."""

MOST_WORK = 16 * LARGEST * LARGEST
"""Most comparisons and calls times crossings of the repeat: half a second of work."""

LARGEST_NUMBER = 10**6
"""Largest constant; its product with a thread number stays far below 64 bits."""

ROWS = 64
"""Ends that are evaluated at once, few enough that intermediate results stay in the cache."""

Grid = NDArray[np.int64]
Values = NDArray[np.generic]
Evaluate = Callable[[Grid, Grid], Values]

FORM = "as in mod(2*i + j, 5) != 0"

COMPARE: dict[type[ast.cmpop], Callable[[Values, Values], Values]] = {
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
}


@dataclass(frozen=True)
class _Linear:
    """a i + b j + c."""

    a: int = 0
    b: int = 0
    c: int = 0

    def __call__(self, i: Grid, j: Grid) -> Values:
        return np.asarray(self.a * i + self.b * j + self.c)


@dataclass(frozen=True)
class _Term:
    """A number, or a truth value, for each cell; it repeats after `ends` and `picks`."""

    evaluate: Evaluate
    ends: int
    picks: int
    truth: bool = False


def parse_expression(text: str) -> Draft:
    """The draft of a weave expression, whose repeat is the shortest that the numbers imply.

    The weave is called by its usual name if it has one (`twill 1/4 S`), and otherwise by `text`.
    Raises FabricError for text that is not an expression, and for a repeat above `LARGEST`.
    """
    where = f"weave expression {quoted(text)}"
    if len(text) > LONGEST:
        raise FabricError(where, f"is {len(text)} characters long; it must be at most {LONGEST}")
    try:
        tree, terms = _tree(text)
        term = _term(tree)
        if not term.truth:
            raise FabricError("", f"is a number; it must be a comparison, {FORM}")
        if max(term.ends, term.picks) > LARGEST:
            raise FabricError(
                "", f"repeats after {term.ends} x {term.picks}; it must be at most {LARGEST}"
            )
        crossings = term.ends * term.picks
        if terms * crossings > MOST_WORK:
            raise FabricError(
                "",
                f"has {terms} comparisons and calls over a repeat of {term.ends} x {term.picks}; "
                f"for a repeat of that size it must have at most {MOST_WORK // crossings}",
            )
    except FabricError as error:
        raise error.inside(where) from None
    cells = _cells(term)
    name = recognise(cells)
    return Draft(
        weave=Weave(cells, name or text.strip()),
        title=name or text.strip(),
        source=text,
        warnings=_not_a_satin(text, name),
    )


def _cells(term: _Term) -> NDArray[np.bool_]:
    """(ends, picks) bool truth of `term`, read-only."""
    cells = np.empty((term.ends, term.picks), np.bool_)
    j = np.arange(term.picks)[None, :]
    for begin in range(0, term.ends, ROWS):
        i = np.arange(begin, min(begin + ROWS, term.ends))[:, None]
        cells[begin : begin + ROWS] = term.evaluate(i, j)
    cells.flags.writeable = False
    return cells


def _not_a_satin(text: str, name: str) -> tuple[str, ...]:
    """A warning if it is a twill where a satin may be meant, or nothing.

    The thesis prints `mod(i + j, N) == 0` as a satin; above N = 2 it is a twill.
    """
    runs = name.split()[1].split("/") if name.startswith("twill") else []
    if len(runs) == 2 and "1" in runs and sum(map(int, runs)) > 3:
        return (
            f"'{text.strip()}' is a {name}; a satin of {sum(map(int, runs))} needs a step of 2 "
            f"or more, coprime to {sum(map(int, runs))}, before i or j.",
        )
    return ()


def _tree(text: str) -> tuple[ast.expr, int]:
    """The syntax tree of an expression, and the number of its comparisons and calls."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            tree = ast.parse(text.strip(), mode="eval").body
    except SyntaxError as error:
        place = f"at character {error.offset}" if error.offset else ""
        raise FabricError(place, f"cannot be read; write it {FORM}") from None
    except (ValueError, MemoryError, RecursionError):
        raise FabricError("", f"cannot be read; write it {FORM}") from None
    level, depth, terms = [tree], 0, 0
    while level:
        depth += 1
        terms += sum(isinstance(node, ast.Call | ast.Mod) for node in level)
        # One comparison may be a chain of several: 1 <= a < b < c.
        terms += sum(len(node.ops) for node in level if isinstance(node, ast.Compare))
        level = [child for node in level for child in ast.iter_child_nodes(node)]  # type: ignore
    if depth > DEEPEST:
        raise FabricError("", f"is nested {depth} deep; it must be at most {DEEPEST}")
    if terms > MOST_TERMS:
        raise FabricError(
            "", f"has {terms} comparisons and calls; it must have at most {MOST_TERMS}"
        )
    return tree, terms


def _term(node: ast.expr) -> _Term:
    """The truth value or the periodic number that `node` stands for."""
    if isinstance(node, ast.BoolOp):
        join = np.logical_and if isinstance(node.op, ast.And) else np.logical_or
        terms = [_truth(value) for value in node.values]
        return _join(terms, lambda values: functools.reduce(join, values))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return _join([_truth(node.operand)], lambda values: np.logical_not(next(values)))
    if isinstance(node, ast.Compare):
        return _comparison(node)
    if isinstance(node, ast.Call):
        return _call(node)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod):
        return _mod(node.left, node.right)
    number = _linear(node)
    if number.a or number.b:
        raise FabricError(
            quoted(ast.unparse(node), 40), f"grows without end; put i and j inside mod(), {FORM}"
        )
    return _Term(number, 1, 1)


def _truth(node: ast.expr) -> _Term:
    term = _term(node)
    if not term.truth:
        raise FabricError(quoted(ast.unparse(node), 40), f"must be a comparison, {FORM}")
    return term


def _number(node: ast.expr) -> _Term:
    term = _term(node)
    if term.truth:
        raise FabricError(quoted(ast.unparse(node), 40), "is true or false; it must be a number")
    return term


def _join(terms: list[_Term], combine: Callable[[Iterator[Values]], Values]) -> _Term:
    """The truth value that `combine` makes of the terms, in order; it repeats when they all do."""
    return _Term(
        lambda i, j: combine(t.evaluate(i, j) for t in terms),
        math.lcm(*(t.ends for t in terms)),
        math.lcm(*(t.picks for t in terms)),
        truth=True,
    )


def _comparison(node: ast.Compare) -> _Term:
    tests = [COMPARE[type(op)] for op in node.ops if type(op) in COMPARE]
    if len(tests) < len(node.ops):
        raise FabricError(quoted(ast.unparse(node), 40), "must use ==, !=, <, <=, > or >=")

    terms = [_number(value) for value in (node.left, *node.comparators)]

    def combine(values: Iterator[Values]) -> Values:
        left, result = next(values), np.asarray(True)
        for test, right in zip(tests, values, strict=True):
            result = np.logical_and(result, test(left, right))
            left = right
        return result

    return _join(terms, combine)


def _call(node: ast.Call) -> _Term:
    name = node.func.id if isinstance(node.func, ast.Name) else ""
    wanted = {"mod": 2, "shift": 3, "scale": 3}.get(name)
    if wanted is None:
        raise FabricError(
            quoted(ast.unparse(node.func), 40), "is not known; it must be mod, shift or scale"
        )
    if len(node.args) != wanted or node.keywords:
        raise FabricError(
            f"'{name}'",
            f"has {len(node.args) + len(node.keywords)} arguments; it must have {wanted}",
        )
    if name == "mod":
        return _mod(node.args[0], node.args[1])
    inner = _truth(node.args[0])
    a, b = _constant(node.args[1]), _constant(node.args[2])
    if name == "shift":
        return replace(inner, evaluate=lambda i, j: inner.evaluate(i - a, j - b))
    if a < 1 or b < 1:
        raise FabricError("'scale'", f"is by {a} x {b}; both numbers must be at least 1")
    return replace(
        inner,
        evaluate=lambda i, j: inner.evaluate(i // a, j // b),
        ends=inner.ends * a,
        picks=inner.picks * b,
    )


def _mod(value: ast.expr, divisor: ast.expr) -> _Term:
    n = _constant(divisor)
    if n < 1:
        raise FabricError("'mod'", f"divides by {n}; the divisor must be at least 1")
    if _is_periodic(value):
        term = _number(value)
        return replace(term, evaluate=lambda i, j: np.mod(term.evaluate(i, j), n))
    number = _linear(value)

    def evaluate(i: Grid, j: Grid) -> Values:
        # Reduce ends and picks separately first, so that the full grid holds small numbers.
        along = np.mod(number.a * i, n).astype(np.int32)
        across = np.mod(number.b * j + number.c, n).astype(np.int32)
        return np.asarray(np.mod(along + across, np.int32(n)))

    return _Term(evaluate, n // math.gcd(number.a, n), n // math.gcd(number.b, n))


def _is_periodic(node: ast.expr) -> bool:
    return any(
        isinstance(part, ast.Call) or (isinstance(part, ast.BinOp) and isinstance(part.op, ast.Mod))
        for part in ast.walk(node)
    )


def _linear(node: ast.expr) -> _Linear:
    """`node` as a i + b j + c, or FabricError."""
    found = _linear_or_none(node)
    if found is None:
        raise FabricError(
            quoted(ast.unparse(node), 40),
            f"is not a sum of whole multiples of i and j; write it {FORM}",
        )
    if max(abs(found.a), abs(found.b), abs(found.c)) > LARGEST_NUMBER:
        raise FabricError(
            quoted(ast.unparse(node), 40),
            f"has a number above {LARGEST_NUMBER}; numbers must be at most that",
        )
    return found


def _linear_or_none(node: ast.expr) -> _Linear | None:
    if isinstance(node, ast.Name):
        return {"i": _Linear(a=1), "j": _Linear(b=1)}.get(node.id)
    if isinstance(node, ast.Constant):
        return _Linear(c=node.value) if type(node.value) is int else None
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        sign = -1 if isinstance(node.op, ast.USub) else 1
        x = _linear(node.operand)
        return _Linear(sign * x.a, sign * x.b, sign * x.c)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub | ast.Mult):
        x, y = _linear(node.left), _linear(node.right)
        if isinstance(node.op, ast.Mult):
            if x.a or x.b:
                x, y = y, x
            return None if x.a or x.b else _Linear(x.c * y.a, x.c * y.b, x.c * y.c)
        sign = -1 if isinstance(node.op, ast.Sub) else 1
        return _Linear(x.a + sign * y.a, x.b + sign * y.b, x.c + sign * y.c)
    return None


def _constant(node: ast.expr) -> int:
    number = _linear(node)
    if number.a or number.b:
        raise FabricError(quoted(ast.unparse(node), 40), "must be a whole number")
    return number.c

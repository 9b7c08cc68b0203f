"""The one exception that a caller of fabricusd has to catch, and what makes it of all others."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

BUGS = (TypeError, LookupError, AttributeError, AssertionError, NameError, ArithmeticError)
"""What a program that is wrong raises. Readers of damaged files raise these too, but should have
said what is damaged."""

REPORT = "fabricusd did not expect this: please report it with the file"
"""What is added to an error that only a reader's bug explains."""


def one_line(text: str, longest: int = 600) -> str:
    """`text` on one line of at most `longest` characters, `?` for what would not print.

    What libraries say of a damaged file holds line ends and bytes of that file.
    """
    line = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    return line if len(line) <= longest else line[: longest - 3] + "..."


class FabricError(ValueError):
    """Input that cannot be used: where it is, what it holds, what would be accepted.

    Commands print it as one line and leave with status 2.
    """

    def __init__(self, where: str, problem: str) -> None:
        self.where = where
        self.problem = problem
        super().__init__(f"{where} {problem}" if where else problem)

    def inside(self, where: str) -> FabricError:
        """The same problem, with `where` put before its place."""
        return FabricError(f"{where} {self.where}".strip(), self.problem)


class FabricWarning(UserWarning):
    """Input that is used, though not all of it as it stands: one line, as of a `FabricError`."""


@contextmanager
def reading(source: object, kind: str) -> Iterator[None]:
    """Turn whatever a reader raises in the block into a FabricError with the file's name.

    source : the file, or what else is read; kind : what it is read as, "a WIF draft"

    A FabricError goes through as it is. So do the lack of a library and the warnings that the
    caller has made errors: they are not the file's. What raised a FabricError is its `__cause__`,
    which FABRICUSD_DEBUG shows.
    """
    try:
        yield
    except (FabricError, ImportError, Warning):
        raise
    except OSError as error:
        problem = f"cannot be read: {error.strerror or described(error)}"
        raise FabricError(_name(source), problem) from error
    except MemoryError as error:
        problem = f"cannot be read as {kind}: there is not memory enough for it"
        raise FabricError(_name(source), problem) from error
    except RecursionError as error:
        problem = f"cannot be read as {kind}: it is nested too deeply"
        raise FabricError(_name(source), problem) from error
    except Exception as error:
        problem = f"cannot be read as {kind}: {described(error)}"
        if isinstance(error, BUGS):
            problem += f"; {REPORT}"
        raise FabricError(_name(source), problem) from error


def reads(kind: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """`reading` for a whole function, whose first text or path is the file."""

    def decorate(read: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(read)
        def guarded(*arguments: P.args, **named: P.kwargs) -> R:
            given = (*arguments, *named.values())
            source = next((one for one in given if isinstance(one, str | os.PathLike)), None)
            with reading(source, kind):
                return read(*arguments, **named)

        return guarded

    return decorate


def described(error: BaseException) -> str:
    """An exception's type and message on one line: `IndexError: list index out of range`."""
    name = type(error).__name__
    if name == "error":  # zlib's, struct's
        name = f"{type(error).__module__}.error"
    return one_line(f"{name}: {error}" if str(error) else name, 300)


def debugging() -> bool:
    """Whether FABRICUSD_DEBUG asks for tracebacks besides the one line."""
    return os.environ.get("FABRICUSD_DEBUG", "0") not in ("", "0")


def _name(source: object) -> str:
    return str(source) if isinstance(source, str | os.PathLike) else "the input"

"""The one exception that a caller of fabricusd has to catch, and how other errors become it."""

from __future__ import annotations

import difflib
import functools
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

BUGS = (TypeError, LookupError, AttributeError, AssertionError, NameError, ArithmeticError)
"""Exceptions that mean a bug in the program. Readers raise them for damaged files too, but should
have said what is damaged."""

REPORT = "fabricusd did not expect this: please report it with the file"
"""Added to an error that only a bug in a reader explains."""


def one_line(text: str, longest: int = 600) -> str:
    """`text` on one line of at most `longest` characters, with `?` for unprintable characters.

    Libraries quote a damaged file in their messages, line ends and raw bytes included.
    """
    line = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    return line if len(line) <= longest else line[: longest - 3] + "..."


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """` (did you mean 'twill'?)`, with the nearest of the `known` words; "" where none is near."""
    names = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word.lower()[:200], names, n=1)
    return f" (did you mean '{names[near[0]]}'?)" if near else ""


class FabricError(ValueError):
    """Unusable input: where it is, what it holds, what would be accepted.

    Commands print it as one line and exit with status 2.
    """

    def __init__(self, where: str, problem: str) -> None:
        self.where = where
        self.problem = problem
        super().__init__(f"{where} {problem}" if where else problem)

    def __reduce__(self) -> tuple[type[FabricError], tuple[str, str]]:
        # An exception is unpickled from `args`, which here is the one line.
        return type(self), (self.where, self.problem)

    def inside(self, where: str) -> FabricError:
        """The same problem, its place prefixed by `where`."""
        return FabricError(f"{where} {self.where}".strip(), self.problem)


class FabricWarning(UserWarning):
    """Input that is used, though not all of it as it stands: one line, as of a `FabricError`."""


@contextmanager
def reading(source: object, kind: str) -> Iterator[None]:
    """Turn whatever a reader raises in the block into a FabricError that names the file.

    source : the file, or whatever else is read; kind : what it is read as, such as "a WIF draft"

    A FabricError passes through unchanged. So do a missing library and a warning that the caller
    has turned into an error: neither is the file's fault. The original is the `__cause__`,
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
        problem = f"cannot be read as {kind}: there is not enough memory for it"
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
    """`reading` around a whole function, whose first string or path argument is the file."""

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
    """Whether FABRICUSD_DEBUG asks for a traceback in addition to the one line."""
    return os.environ.get("FABRICUSD_DEBUG", "0") not in ("", "0")


def _name(source: object) -> str:
    return str(source) if isinstance(source, str | os.PathLike) else "the input"

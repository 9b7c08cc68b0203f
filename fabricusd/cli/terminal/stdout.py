"""Handling of standard output, so that no kind of output makes a command end in a traceback."""

from __future__ import annotations

import os
import sys
from contextlib import suppress


def ready_stdout() -> None:
    """Print characters that the encoding lacks as `?`; let a closed output discard its text."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="replace")


def drop_stdout() -> None:
    """Keep Python from complaining at exit about an output that was closed."""
    # A program may have replaced stdout by an object without a descriptor.
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def can_show(text: str) -> bool:
    """Whether the encoding of standard output has all characters of `text`."""
    try:
        text.encode(sys.stdout.encoding or "ascii")
    except UnicodeEncodeError:
        return False
    return True


def write_utf8(text: str) -> None:
    """Print a USD layer or a WIF file, which are always UTF-8."""
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(encoding="utf-8")
    sys.stdout.write(text)

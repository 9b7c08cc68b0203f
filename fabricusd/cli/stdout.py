"""Standard output: whatever it is, no command ends in a traceback for it."""

from __future__ import annotations

import os
import sys
from contextlib import suppress


def ready_stdout() -> None:
    """Let text that the terminal's encoding lacks come out as `?`; a closed output takes all."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="replace")


def drop_stdout() -> None:
    """Keep Python from complaining at exit of an output that takes no more."""
    # What a program has put in its place may have no descriptor.
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def can_show(text: str) -> bool:
    """Whether the encoding of standard output has the characters of `text`."""
    try:
        text.encode(sys.stdout.encoding or "ascii")
    except UnicodeEncodeError:
        return False
    return True


def write_utf8(text: str) -> None:
    """A USD layer or a WIF file, which are UTF-8 wherever they are printed."""
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(encoding="utf-8")
    sys.stdout.write(text)

"""The program `fabricusd`: `main`, without what Python does for programs that live longer."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from typing import NoReturn

from fabricusd.cli.main import main, refused
from fabricusd.cli.stdout import drop_stdout

GARBAGE = (100_000, 20, 100)
"""When Python looks for cycles. Importing USD and numba makes objects by the hundred thousand, none
of them garbage; looking through them time and again takes as long as importing NumPy."""


def program() -> NoReturn:
    """Run the command line; the console entry point."""
    gc.set_threshold(*GARBAGE)
    try:
        status = main()
    except SystemExit as stop:
        status = stop.code if isinstance(stop.code, int) else 0
    leave(status)


def leave(status: int) -> NoReturn:
    """End the program with all that was written.

    Python would first take apart every module, which for USD and numba takes a third of a second:
    a fifth of the time of a small picture.
    """
    full = _flush()
    # Temporary folders, logs: whatever asked to be told of the end.
    atexit._run_exitfuncs()
    full = full or _flush()
    os._exit(refused(f"the output cannot be written: {full}") if full else status)


def _flush() -> str | None:
    """Write what is still held back; the reason where that cannot be."""
    # Streams that were closed when the program was started are None.
    for stream in filter(None, (sys.stdout, sys.stderr)):
        try:
            stream.flush()
        except BrokenPipeError:
            # A reader such as `head` has had enough.
            drop_stdout()
        except OSError as error:
            drop_stdout()
            return error.strerror
    return None

"""The program `fabricusd`: `main`, without the work that Python does for long-running programs."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from typing import NoReturn

from fabricusd.cli.main import main, refused
from fabricusd.cli.terminal.stdout import drop_stdout

GARBAGE = (100_000, 20, 100)
"""Thresholds of Python's garbage collector. Importing USD and numba creates hundreds of thousands
of objects, none of them garbage; scanning them repeatedly takes as long as importing NumPy."""


def program() -> NoReturn:
    """Run the command line. This is the console entry point."""
    gc.set_threshold(*GARBAGE)
    try:
        status = main()
    except SystemExit as stop:
        status = stop.code if isinstance(stop.code, int) else 0
    leave(status)


def leave(status: int) -> NoReturn:
    """End the program once all output is written.

    A normal exit would first tear down every module, which for USD and numba takes a third of a
    second: a fifth of the time of a small picture.
    """
    full = _flush()
    # Handlers that libraries registered for the exit, such as those of temporary folders and logs.
    atexit._run_exitfuncs()
    full = full or _flush()
    os._exit(refused(f"the output cannot be written: {full}") if full else status)


def _flush() -> str | None:
    """Flush the output; return the reason if that fails."""
    # A stream that was closed when the program started is None.
    for stream in filter(None, (sys.stdout, sys.stderr)):
        try:
            stream.flush()
        except BrokenPipeError:
            # The reader of the output, such as `head`, has closed it.
            drop_stdout()
        except OSError as error:
            drop_stdout()
            return error.strerror
    return None

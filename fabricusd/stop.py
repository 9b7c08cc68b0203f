"""Stopping on Ctrl-C and on termination signals without losing a picture."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any

SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
"""Ctrl-C, a request to terminate, and the loss of the terminal. Windows has no SIGHUP."""


class Stop:
    """A context in which termination signals raise KeyboardInterrupt, as Ctrl-C does.

    Between `hold` and `release` they only set `asked`, however often they arrive: a picture is
    being made or written, and its maker polls `asked`. Handlers that the caller has installed are
    left alone, and so are signals that are ignored, as nohup ignores SIGHUP. In a thread other than
    the main one, which alone may have handlers, nothing is installed. In nested contexts the inner
    one receives the signal.
    """

    def __init__(self) -> None:
        self.asked = False
        self._held = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Stop:
        if threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                before = signal.getsignal(number)
                nobody = before in (signal.default_int_handler, signal.SIG_DFL)
                if nobody or isinstance(getattr(before, "__self__", None), Stop):
                    signal.signal(number, self._hear)
                    self._before[number] = before
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)

    def hold(self) -> None:
        """From here on only set `asked`; raise now if a signal came before and a library ate it."""
        self._held = True
        if self.asked:
            raise KeyboardInterrupt

    def release(self) -> None:
        """From here on, raise again."""
        self._held = False

    def _hear(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
        if not self._held:
            raise KeyboardInterrupt

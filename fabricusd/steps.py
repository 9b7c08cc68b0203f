"""Long steps of a run: they are told by name, and can be broken off between their parts.

Whoever makes a table goes over its parts with `parts`; whoever runs it says with `watched` who is
told, and which `Stop` is polled. Neither knows the other:

    with watched(listener=show):
        for part in parts("horizon table of 'damask'", chunks):
            ...
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, NamedTuple, TypeVar

from fabricusd.stop import Stop

Listener = Callable[[str, int, int], Any]
"""Called with the name of a step, the number of its parts, and the number of those done: at first
0, at last all of them. The last call says that the step is over, even where it was broken off."""

Part = TypeVar("Part")


class Watch(NamedTuple):
    """Who is told of steps, and the handler that asks them to stop; None for nobody."""

    listener: Listener | None = None
    stop: Stop | None = None


_watch: ContextVar[Watch] = ContextVar("watch", default=Watch())  # noqa: B039, a frozen default


def current() -> Watch:
    """The watch of the calling thread. A new thread has none: pass it on, see `watched`."""
    return _watch.get()


@contextmanager
def watched(
    watch: Watch | None = None, *, listener: Listener | None = None, stop: Stop | None = None
) -> Iterator[Watch]:
    """A context in which steps are told to `listener` and broken off when `stop` was asked.

    watch : what to start from; the current one by default. None keeps its listener or its handler
    """
    held = watch or current()
    token = _watch.set(Watch(listener or held.listener, stop or held.stop))
    try:
        yield _watch.get()
    finally:
        _watch.reset(token)


def parts(name: str, items: Sequence[Part]) -> Iterator[Part]:
    """Go over `items`, the parts of the step `name`, each of which takes well below two seconds.

    Raises KeyboardInterrupt before the next part where the handler was asked to stop.
    """
    watch, total = current(), len(items)
    try:
        for done, item in enumerate(items):
            if watch.stop is not None and watch.stop.asked:
                raise KeyboardInterrupt
            if watch.listener is not None:
                watch.listener(name, total, done)
            yield item
    finally:
        if watch.listener is not None:
            watch.listener(name, total, total)

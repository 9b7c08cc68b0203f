"""What the fuzz tests share: how many inputs they try, what one may cost, and how it is damaged.

`FABRICUSD_FUZZ=long pytest tests/...` tries the numbers that docs/robustness.md states; without
it each test tries a few, so that the suite stays short.
"""

from __future__ import annotations

import faulthandler
import gc
import os
import random
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from hypothesis import strategies as st

from fabricusd.errors import FabricError

SECONDS = 1.0
"""Most processor time of one input. Not time on the clock, of which a busy machine takes more."""

MEGABYTES = 500
"""Most memory of one input, above what the process had before."""

STUCK = 120.0
"""Time on the clock after which a process that no signal interrupts is ended with its traceback."""


def examples(default: int, by_hand: int) -> int:
    """Inputs to try: `by_hand` where FABRICUSD_FUZZ is "long", else `default`."""
    return by_hand if os.environ.get("FABRICUSD_FUZZ") == "long" else default


class Hang(AssertionError):
    """An input took longer than it may."""


@contextmanager
def no_hang(seconds: float = SECONDS) -> Iterator[None]:
    """Fail with `Hang` once the block has used `seconds` of processor time.

    Code that catches the exception and goes on fails at the block's end. A call into a library that
    never returns ends the process after `STUCK`. Systems without interval timers try all the same.
    """
    if not hasattr(signal, "setitimer"):
        yield
        return
    late: list[str] = []

    def stop(*_: object) -> None:
        late.append(f"not done after {seconds:g} s of processor time")
        raise Hang(late[0])

    before = signal.signal(signal.SIGPROF, stop)
    # Looking through what hypothesis keeps of a long run takes a second by itself.
    collecting = gc.isenabled()
    gc.disable()
    faulthandler.dump_traceback_later(STUCK, exit=True, file=sys.__stderr__)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGPROF, before)
        if collecting:
            gc.enable()
    if late:
        raise Hang(late[0])


@contextmanager
def bounded_memory(megabytes: int = MEGABYTES) -> Iterator[None]:
    """Let the block's process grow by at most `megabytes`: what asks for more gets a MemoryError.

    By the address space, which is a bound from above on what is used; where the system cannot say
    how large a process is, the block runs without a bound.
    """
    if sys.platform != "linux":
        yield
        return
    import resource

    with open("/proc/self/statm") as stream:
        pages = int(stream.read().split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    most = pages * resource.getpagesize() + megabytes * 2**20
    if before[1] != resource.RLIM_INFINITY:
        most = min(most, before[1])
    resource.setrlimit(resource.RLIMIT_AS, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


@contextmanager
def guarded(seconds: float = SECONDS, megabytes: int = MEGABYTES) -> Iterator[None]:
    """`no_hang` and `bounded_memory` together."""
    with no_hang(seconds), bounded_memory(megabytes):
        yield


def refusal(read: Callable[..., Any], *arguments: Any) -> str:
    """ "" where `read` takes what it is given, else its one line; any other exception gets through.

    Both within the bounds of `guarded`.
    """
    with guarded():
        try:
            read(*arguments)
        except FabricError as error:
            # A bound that is met by a MemoryError was not judged, whatever is said of it.
            if isinstance(error.__cause__, MemoryError):
                raise error.__cause__ from None
            message = str(error)
        else:
            return ""
    assert message, "a refusal that says nothing"
    assert message.isprintable(), f"more than one plain line: {message!r}"
    return message


def in_child(function: Callable[[], None], seconds: float = STUCK) -> None:
    """Run `function` in a forked child, for libraries that end the whole process on bad input.

    Fails where the child ends with a traceback, by a signal, or not at all after `seconds` on the
    clock. The child has `MEGABYTES` more than this process.
    """
    if not hasattr(os, "fork"):
        function()
        return
    child = os.fork()
    if child == 0:
        status = 1
        try:
            signal.alarm(int(seconds) + 1)
            with bounded_memory():
                function()
            status = 0
        except BaseException:
            import traceback

            traceback.print_exc(file=sys.__stderr__)
        finally:
            os._exit(status)
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    assert code == 0, f"the child ended by signal {-code}" if code < 0 else "the child failed"


WORDS = tuple(
    number.to_bytes(size, order)  # type: ignore[arg-type]
    for size in (2, 4, 8)
    for order in ("little", "big")
    for number in (0, 1, 2 ** (4 * size), 2 ** (8 * size - 1) - 1, 2 ** (8 * size) - 1)
)
"""Numbers that readers trip over, as binary files hold them."""

TOKENS = (
    *(word.encode() for word in ["0", "-1", "1e999", "nan", "inf", "9" * 11, "..", "é", "\u2028"]),
    *(char.encode() for char in "\n\r\0 \t,=[](){}\"'#;/\\%"),
    *(b"\r\n", b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf", b"\xff", b"\x80"),
)
"""Bytes that readers of text trip over."""


def damaged(
    choose: Callable[[int, int], int], good: Sequence[bytes], junk: Sequence[bytes], most: int
) -> bytes:
    """One of `good` with up to `most` places overwritten, grown, cut, flipped, doubled or moved.

    choose : gives a whole number between two, both included
    """
    data = bytearray(good[choose(0, len(good) - 1)])
    for _ in range(choose(1, most)):
        kind, at = choose(0, 6), choose(0, len(data))
        if kind == 0:
            piece = junk[choose(0, len(junk) - 1)]
            data[at : at + len(piece)] = piece
        elif kind == 1:
            piece = junk[choose(0, len(junk) - 1)]
            data[at:at] = piece if choose(0, 1) else bytes([choose(0, 255)])
        elif kind == 2:
            del data[at : at + choose(1, 16)]
        elif kind == 3 and at < len(data):
            data[at] ^= 1 << choose(0, 7)
        elif kind in (4, 5):
            piece = bytes(data[at : at + choose(1, 64)])
            to = at
            if kind == 5:
                del data[at : at + len(piece)]
                to = choose(0, len(data))
            data[to:to] = piece
        elif kind == 6:
            del data[at:]
    return bytes(data)


def mutated(
    good: bytes | Sequence[bytes], junk: Sequence[bytes] = WORDS + TOKENS, most: int = 6
) -> st.SearchStrategy[bytes]:
    """One of `good`, `damaged`; `junk` is what is thrown in.

    In a long run from one number each, which is twice as fast; else choice by choice, so that what
    fails becomes as small as it can be.
    """
    files = (good,) if isinstance(good, bytes) else tuple(good)
    if examples(0, 1):
        return st.integers(0, 2**64 - 1).map(
            lambda seed: damaged(random.Random(seed).randint, files, junk, most)
        )

    @st.composite
    def chosen(draw: st.DrawFn) -> bytes:
        return damaged(lambda low, high: draw(st.integers(low, high)), files, junk, most)

    return chosen()

"""Show a picture in the terminal, where that can show pictures: kitty's, iTerm2's protocol, sixel.

The protocols are a few escape sequences each. Sixel has a palette: its colours are a cube of
LEVELS levels a channel, dithered in the pattern of [Bayer1973].
"""

from __future__ import annotations

import base64
import os
import select
import sys
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

KITTY, ITERM, SIXEL = "kitty", "iterm2", "sixel"

LEVELS = 6

_CHUNK = 4096
"""Most characters of a piece of a picture that kitty takes at once."""

_WAIT = 0.2
"""Seconds in which a terminal says what it is."""

_BAYER = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]])


def protocol_of(environment: Mapping[str, str]) -> str:
    """The protocol that a terminal is known to have by its variables, or ""."""
    program = environment.get("TERM_PROGRAM", "")
    if "KITTY_WINDOW_ID" in environment or environment.get("TERM", "").startswith("xterm-kitty"):
        return KITTY
    if program == "ghostty":
        return KITTY
    if program in ("iTerm.app", "WezTerm") or environment.get("LC_TERMINAL") == "iTerm2":
        return ITERM
    return ""


def terminal_protocol() -> str:
    """The protocol of the terminal on standard output, which is asked for sixel; "" for none."""
    if not sys.stdout.isatty():
        return ""
    return protocol_of(os.environ) or (SIXEL if has_sixel(_attributes()) else "")


def has_sixel(answer: str) -> bool:
    """Whether the answer to a request for device attributes names sixel: a parameter 4."""
    start, end = answer.find("\x1b[?"), answer.rfind("c")
    return start >= 0 and "4" in answer[start + 3 : end].split(";")[1:]


def shown(protocol: str, png: bytes, pixels: NDArray[np.uint8]) -> str:
    """The characters that show a picture, given as a PNG and as (h, w, 3) codes."""
    if protocol == KITTY:
        return kitty(png)
    return iterm2(png) if protocol == ITERM else sixel(pixels)


def kitty(png: bytes) -> str:
    """The picture in the protocol of kitty."""
    text = base64.b64encode(png).decode()
    parts = [text[k : k + _CHUNK] for k in range(0, len(text), _CHUNK)]
    out = []
    for k, part in enumerate(parts):
        first = "a=T,f=100," if k == 0 else ""
        out.append(f"\x1b_G{first}m={int(k < len(parts) - 1)};{part}\x1b\\")
    return "".join(out) + "\n"


def iterm2(png: bytes) -> str:
    """The picture in the protocol of iTerm2."""
    text = base64.b64encode(png).decode()
    return f"\x1b]1337;File=inline=1;size={len(png)}:{text}\a\n"


def sixel(pixels: NDArray[np.uint8]) -> str:
    """(h, w, 3) codes as sixel."""
    h, w, _ = pixels.shape
    rows, columns = -(-h // 4), -(-w // 4)
    threshold = (np.tile(_BAYER, (rows, columns))[:h, :w] + 0.5) / 16.0
    level = pixels * ((LEVELS - 1) / 255.0)
    digits = np.minimum((level + threshold[..., None]).astype(np.int64), LEVELS - 1)
    number = (digits * [LEVELS * LEVELS, LEVELS, 1]).sum(axis=-1)
    out = [f'\x1bPq"1;1;{w};{h}']
    for k in range(LEVELS**3):
        percent = [round(100 * d / (LEVELS - 1)) for d in (k // 36, k // 6 % 6, k % 6)]
        out.append("#{};2;{};{};{}".format(k, *percent))
    for top in range(0, h, 6):
        band = number[top : top + 6]
        bits = (1 << np.arange(len(band)))[:, None]
        lines = []
        for color in np.unique(band):
            column = ((band == color) * bits).sum(axis=0)
            lines.append(f"#{color}{_runs(column + 63)}")
        out.append("$".join(lines) + "-")
    out.append("\x1b\\\n")
    return "".join(out)


def _runs(codes: NDArray[np.int64]) -> str:
    """Characters of `codes`, repeated ones by their number."""
    starts = np.flatnonzero(np.diff(codes, prepend=-1))
    counts = np.diff(starts, append=len(codes))
    return "".join(
        f"!{n}{chr(c)}" if n > 3 else chr(c) * n
        for c, n in zip(codes[starts].tolist(), counts.tolist(), strict=True)
    )


def _attributes() -> str:
    """What the terminal answers to a request for its device attributes, or ""."""
    try:
        import termios
        import tty
    except ImportError:  # not on Windows
        return ""
    try:
        stream = os.open("/dev/tty", os.O_RDWR | os.O_NOCTTY)
    except OSError:
        return ""
    try:
        before = termios.tcgetattr(stream)
        try:
            tty.setcbreak(stream)
            os.write(stream, b"\x1b[c")
            answer = b""
            while b"c" not in answer and select.select([stream], [], [], _WAIT)[0]:
                answer += os.read(stream, 64)
        finally:
            termios.tcsetattr(stream, termios.TCSADRAIN, before)
    except (OSError, termios.error):
        return ""
    finally:
        os.close(stream)
    return answer.decode("ascii", "replace")

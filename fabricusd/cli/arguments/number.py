"""Numbers on the command line; their ranges are checked before any work begins."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from fabricusd.errors import one_line
from fabricusd.ranges import RANGES


def number(setting: str) -> Callable[[str], Any]:
    """The `type` of an option: a parser for a number in the range of that setting."""
    allowed = RANGES[setting]

    def parse(text: str) -> Any:
        try:
            value = int(text) if allowed.whole else float(text)
        except ValueError:
            value = None
        if value not in allowed:
            words = f"is '{one_line(text, 60)}'; it must be {allowed}"
            raise argparse.ArgumentTypeError(words)
        return value

    return parse

"""A parser that reports an error in one line, with the nearest of what would be accepted."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import Any, NoReturn

from fabricusd.errors import did_you_mean, one_line


class Parser(argparse.ArgumentParser):
    """argparse's parser, whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Print one line that points to the help, and exit with status 2."""
        self.exit(2, f"{self.prog}: {one_line(message, 400)}; see '{self.prog} --help'\n")

    def refuse_unknown(self, words: list[str]) -> NoReturn:
        """Refuse words that no option takes, with the option each may be a slip of."""
        known = [name for action in self._actions for name in action.option_strings]
        said = " ".join(f"{word}{did_you_mean(word.partition('=')[0], known)}" for word in words)
        self.error(f"unrecognized arguments: {said}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        choices: Iterable[Any] | None = action.choices
        if choices is None or value in choices:
            return
        known = [str(choice) for choice in choices]
        hint = did_you_mean(str(value), known)
        raise argparse.ArgumentError(
            action, f"invalid choice: {str(value)!r}{hint} (choose from {', '.join(known)})"
        )

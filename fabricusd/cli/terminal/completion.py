"""Completion of command lines in shells, by shtab."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from fabricusd.errors import FabricError

SHELLS = ("bash", "zsh", "tcsh")

FILES = (
    "FILE", "SCENE", "SOURCE", "OUT", "MESH", "A", "B", "PNG", "HTML", "LOOK", "MD", "JSON", "SKY",
    "LOBES",
)  # fmt: skip
FOLDERS = ("DIR", "FOLDER")
"""Placeholders of values that are names of files, or of folders."""


def script(parser: argparse.ArgumentParser, shell: str) -> str:
    """The script that completes the commands and options of `parser` in a shell.

    Raises FabricError if shtab is not installed.
    """
    try:
        import shtab
    except ModuleNotFoundError:
        raise FabricError(
            "--print-completion", "needs shtab; install it with: pip install shtab"
        ) from None
    from fabricusd.schema.source import preset_names

    for action in _actions(parser):
        first = action.metavar[0] if isinstance(action.metavar, tuple) else action.metavar or ""
        word = first.partition("[")[0]
        if "--preset" in action.option_strings:
            action.choices = preset_names()
        elif word in FILES:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
        elif word in FOLDERS:
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
    return str(shtab.complete(parser, shell))


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """The arguments of a parser and of its commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)
        else:
            yield action

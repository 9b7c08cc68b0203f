"""Write docs/reference: the commands as `--help` describes them, and the names of `fabricusd`.

python docs/make_reference.py
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from types import ModuleType
from unittest import mock

import fabricusd
from fabricusd import api
from fabricusd.cli.main import COMMANDS, build_parser

HERE = Path(__file__).parent / "reference"

COMMANDS_HEAD = """# The commands

`python docs/make_reference.py` makes this page from the commands' own help, which
`fabricusd help COMMAND` prints. [Commands: status, signals, files](../commands.md) says what all
commands have in common.

| command | does |
|---|---|
"""

NAMES_HEAD = """# Names of the package

`python docs/make_reference.py` makes this page. Each name is imported from `fabricusd`; the site
shows its signature and its docstring. [Python](../python.md) has examples that run. Angles are
radians and lengths are metres. [appearance.md](../appearance.md) describes the functions of the
appearance model.

"""


def commands_page() -> str:
    """The text of docs/reference/commands.md."""
    # Lines are as wide as they are on a terminal of 80 columns, whatever this one has.
    with mock.patch.dict(os.environ, {"COLUMNS": "80", "NO_COLOR": "1"}):
        parser = build_parser(None, whole=True)
        (group,) = (
            a for a in parser._actions if isinstance(a, argparse._SubParsersAction)
        )  # fmt: skip
        texts = {name: group.choices[name].format_help() for name in COMMANDS}
    rows = [f"| [`{name}`](#{name}) | {line} |" for name, line in COMMANDS.items()]
    parts = [f"## {name}\n\n```text\n{text.rstrip()}\n```\n" for name, text in texts.items()]
    return COMMANDS_HEAD + "\n".join(rows) + "\n\n" + "\n".join(parts)


def names_page() -> str:
    """The text of docs/reference/api.md."""
    places = {name: getattr(fabricusd, name) for name in fabricusd.__all__ if name[0] != "_"}
    parts = []
    for name, value in places.items():
        if isinstance(value, ModuleType):  # a folder of the package that is called
            value = getattr(api, name)
        module = value.__module__
        # Errors have no members worth a line, and functions have none.
        fields = isinstance(value, type) and not issubclass(value, Exception)
        options = "" if fields else "\n    options:\n      members: false"
        parts.append(f"::: {module}.{name}{options}\n")
    return NAMES_HEAD + "\n".join(parts)


PAGES = {"commands.md": commands_page, "api.md": names_page}


def main() -> None:
    """Write the pages."""
    HERE.mkdir(exist_ok=True)
    for name, text in PAGES.items():
        (HERE / name).write_text(text(), encoding="utf-8")


if __name__ == "__main__":
    main()

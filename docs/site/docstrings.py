"""Turns the parameters of this project's docstrings into lists, for the site's reference."""

from __future__ import annotations

import re
from typing import Any

from griffe import Extension, Object

PARAMETER = re.compile(r"(\w[\w, *]*?) : (.*)")


class Parameters(Extension):
    """Lines `name : text`, and the indented lines below each, become a list."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Rewrite the docstring of one object."""
        if obj.docstring:
            obj.docstring.value = listed(obj.docstring.value)


def listed(text: str) -> str:
    """The docstring `text` as Markdown."""
    lines: list[str] = []
    inside = False
    for line in text.splitlines():
        found = PARAMETER.fullmatch(line)
        if found:
            if not inside and lines and lines[-1]:
                lines.append("")
            lines.append(f"- **`{found[1]}`**: {found[2]}")
            inside = True
        else:
            inside = inside and line.startswith(" ")
            lines.append(line)
    return "\n".join(lines)

"""The pages of the documentation, and the commands, links and pictures on them."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]

PAGES = sorted(
    path.relative_to(ROOT).as_posix() for path in [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")]
)
"""Every page, relative to the repository."""

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_INDENTED = re.compile(r"(?:(?<=\n\n)|(?<=\n \n)|\A)(?:    .*\n|\n(?=    ))+", re.MULTILINE)


def text(page: str) -> str:
    """What stands on the page."""
    return (ROOT / page).read_text("utf-8")


def blocks(page: str, language: str) -> list[str]:
    """The fenced blocks in a language."""
    return [block for name, block in _FENCE.findall(text(page)) if name == language]


def prose(page: str) -> str:
    """The page without its blocks of code, the lines of which are kept as empty ones."""

    def emptied(match: re.Match[str]) -> str:
        return "\n" * match[0].count("\n")

    return _INDENTED.sub(emptied, _FENCE.sub(emptied, text(page)))


def lines_of_code(page: str) -> list[str]:
    """Lines of the shell's blocks, fenced or indented, continued lines as one."""
    fenced = [b for name, b in _FENCE.findall(text(page)) if name in ("", "sh", "bash", "console")]
    indented = [
        re.sub(r"^    ", "", block, flags=re.MULTILINE)
        for block in _INDENTED.findall(_FENCE.sub("", text(page)))
    ]
    whole = "\n".join([*fenced, *indented])
    return re.sub(r"\s*\\\n\s*", " ", whole).splitlines()


def commands(page: str) -> list[str]:
    """Lines of the page's code that run `fabricusd`."""
    return [line for line in lines_of_code(page) if line.startswith("fabricusd ")]


def mentioned(page: str) -> list[str]:
    """Command lines within the text, in backticks."""
    return re.findall(r"`(fabricusd [^`]+)`", re.sub(r"\s*\n\s*", " ", prose(page)))


def anchors(page: str) -> set[str]:
    """Anchors of the page's headings, as the site and the repository's viewer make them."""
    found: set[str] = set()
    for line in prose(page).splitlines():
        heading = re.fullmatch(r"#+ (.*)", line)
        if heading:
            words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading[1])
            found.add(re.sub(r"\s+", "-", re.sub(r"[^\w\s-]", "", words).strip().lower()))
    return found


def links(page: str) -> list[str]:
    """Where the page's links and pictures lead."""
    return re.findall(r"\]\(([^)\s]+)\)", prose(page))

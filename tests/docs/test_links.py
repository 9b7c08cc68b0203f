"""Links and pictures of the pages lead to something."""

from __future__ import annotations

import posixpath
import re

import pytest

from tests.docs.pages import PAGES, ROOT, anchors, links, text


def broken(page: str, link: str) -> str:
    """What is wrong with a link; nothing for one that leads somewhere, or to the web."""
    if re.match(r"[a-z]+:", link):
        return ""
    path, _, anchor = link.partition("#")
    there = posixpath.normpath(posixpath.join(posixpath.dirname(page), path)) if path else page
    if not (ROOT / there).is_file():
        return f"{link}: there is no file {there}"
    if anchor and there.endswith(".md") and anchor not in anchors(there):
        return f"{link}: {there} has no heading of that name"
    return ""


@pytest.mark.parametrize("page", PAGES)
def test_every_link_leads_somewhere(page):
    assert [broken(page, link) for link in links(page) if broken(page, link)] == []


def test_a_broken_link_is_found():
    assert "no file" in broken("README.md", "docs/nowhere.md")
    assert "no heading" in broken("README.md", "docs/glossary.md#nowhere")
    assert broken("README.md", "docs/glossary.md#cloth") == ""


@pytest.mark.parametrize("page", PAGES)
def test_a_link_that_is_called_after_a_page_leads_to_that_page(page):
    named = re.findall(r"\[([\w/-]+\.md)\]\(([^)#]+)", text(page))
    assert [pair for pair in named if len({posixpath.basename(name) for name in pair}) > 1] == []


def test_pages_named_in_sources_are_there():
    named: dict[str, str] = {}
    for folder in ("fabricusd", "bench", "tests", "samples"):
        for path in (ROOT / folder).rglob("*.py"):
            # A test may name a page that is missing on purpose.
            if path.is_relative_to(ROOT / "tests" / "docs"):
                continue
            for page in re.findall(r"\bdocs/[\w/-]+\.(?:md|png)\b", path.read_text("utf-8")):
                named[page] = str(path)
    assert {page for page in named if not (ROOT / page).is_file()} == set()


def test_every_decision_is_listed():
    pages = {path.name for path in (ROOT / "docs" / "decisions").glob("[0-9]*.md")}
    assert set(links("docs/decisions/README.md")) == pages


def test_every_picture_is_on_a_page():
    shown = " ".join(text(page) for page in PAGES)
    there = {path.name for path in (ROOT / "docs" / "images").rglob("*.*g")}
    # What `chart` draws beside the PNGs, and git ignores.
    there -= {path.name for path in (ROOT / "docs" / "images" / "charts").glob("*.svg")}
    assert {name for name in there if name not in shown} == set()

"""No page is longer than a reader's patience, but those that are looked things up in."""

from __future__ import annotations

import re

import pytest

from tests.docs.pages import PAGES, text

LONGEST = 2000
"""Words of a page; numbers and names are words, rules and borders of tables are not."""

LOOKED_UP = {
    "CHANGELOG.md",
    "docs/reference/commands.md",
    "docs/schema.md",
}
"""Pages that nobody reads from end to end."""


def words(page: str) -> int:
    """How many words stand on a page."""
    return sum(bool(re.search(r"\w", word)) for word in text(page).split())


@pytest.mark.parametrize("page", sorted(set(PAGES) - LOOKED_UP))
def test_a_page_is_not_too_long(page):
    assert words(page) <= LONGEST


def test_pages_to_look_things_up_in_are_there_and_long():
    assert LOOKED_UP <= set(PAGES)
    assert all(words(page) > LONGEST for page in LOOKED_UP)


def test_how_to_pages_are_short():
    pages = [page for page in PAGES if page.startswith("docs/how-to/")]
    assert {page: words(page) for page in pages if words(page) > 400} == {}

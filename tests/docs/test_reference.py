"""Reference pages are what the program says today."""

from __future__ import annotations

import importlib.util
import sys

import pytest

import fabricusd
from tests.docs.pages import ROOT

MAKER = ROOT / "docs" / "make_reference.py"


def maker():
    """The script that makes the pages."""
    spec = importlib.util.spec_from_file_location("make_reference", MAKER)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", maker().PAGES)
def test_the_page_is_what_the_script_makes(name):
    if name == "commands.md" and sys.version_info[:2] != (3, 11):
        pytest.skip("argparse words its help otherwise in other versions of Python")
    made = maker().PAGES[name]()
    assert (ROOT / "docs" / "reference" / name).read_text("utf-8") == made, (
        "run: python docs/make_reference.py"
    )


def test_every_public_name_is_on_the_page():
    page = (ROOT / "docs" / "reference" / "api.md").read_text("utf-8")
    public = [name for name in fabricusd.__all__ if not name.startswith("_")]
    assert [name for name in public if f".{name}\n" not in page] == []

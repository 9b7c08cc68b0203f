"""The site builds without a warning, and asks nothing of the network."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.pages import PAGES, ROOT


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The site, built as `make site` builds it."""
    folder = tmp_path_factory.mktemp("site")
    run = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-d", str(folder)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(run, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder


def test_every_page_has_its_place(site):
    fronts = {"README.md": "index"}
    for page in PAGES:
        name = page.removeprefix("docs/").removesuffix(".md")
        name = name if page.startswith("docs/") else fronts.get(page, name.lower())
        name = re.sub(r"README$", "index", name)
        assert (site / f"{name}.html").is_file(), page


def test_pages_load_nothing_from_elsewhere(site):
    loads = re.compile(
        r"""<(?:script|img|iframe|link)\b[^>]*?\b(?:src|href)=["']?(https?:[^"' >]+)"""
    )
    found = {
        (page.name, url)
        for page in site.rglob("*.html")
        for url in loads.findall(page.read_text("utf-8"))
        if "canonical" not in url
    }
    assert found == set()


def test_docstrings_are_on_the_site(site):
    page = (site / "reference" / "api.html").read_text("utf-8")
    assert "Path-trace" in page
    assert "<strong><code>spp</code></strong>" in page

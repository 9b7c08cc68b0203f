"""The site builds without a warning, and asks nothing of the network."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.docs.pages import PAGES, ROOT


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The site, built as `make site` builds it."""
    folder = tmp_path_factory.mktemp("site")
    done = built(ROOT / "mkdocs.yml", folder)
    assert done.returncode == 0, done.stderr
    return folder


def built(configuration: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """What MkDocs says of a site. With `--quiet` it would not count warnings."""
    run = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(configuration)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    return subprocess.run(
        [*run, "-d", str(folder)], cwd=ROOT, env=environment, capture_output=True, text=True
    )


def test_a_lost_link_is_a_warning_that_fails_the_build(tmp_path):
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text("# A page\n\n[lost](lost.md)\n")
    said = {"site_name": "x", "docs_dir": "docs"}
    said["validation"] = yaml.safe_load(
        re.search(r"^validation:\n(?:  .*\n)+", (ROOT / "mkdocs.yml").read_text("utf-8"), re.M)[0]
    )["validation"]
    (tmp_path / "mkdocs.yml").write_text(yaml.safe_dump(said))
    done = built(tmp_path / "mkdocs.yml", tmp_path / "site")
    assert done.returncode == 1
    assert "lost.md" in done.stderr


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

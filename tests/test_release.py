"""What a release consists of: the version, changelog, citation, and the files that are built."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

from fabricusd import __version__
from tests.docs.pages import ROOT

LEFT_OUT = (".venv", "build", "demo", "dist", "__pycache__", "*.egg-info", ".*_cache")
"""What a build needs nothing of, and what would take long to copy."""

HEADINGS = ["Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"]


def test_the_version_is_one_that_python_knows():
    assert re.fullmatch(r"\d+(\.\d+)*((a|b|rc)\d+)?(\.dev\d+)?(\+[\w.]+)?", __version__)


def test_the_changelog_has_the_form_of_keep_a_changelog():
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    versions = re.findall(r"^## (.*)$", text, re.MULTILINE)
    assert versions[0] == "[Unreleased]"
    released = re.compile(r"\[\d+\.\d+\.\d+\] - \d{4}-\d{2}-\d{2}")
    assert [v for v in versions[1:] if not released.fullmatch(v)] == []
    for part in re.split(r"^## .*$", text, flags=re.MULTILINE)[1:]:
        kinds = re.findall(r"^### (.*)$", part, re.MULTILINE)
        assert kinds == [heading for heading in HEADINGS if heading in kinds]


def test_the_citation_has_what_its_format_asks_for():
    said = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert said["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= set(said)
    assert said["license"] == project["license"]
    assert [each["title"] for each in said["references"] if not each["authors"]] == []


@pytest.mark.parametrize("form", sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml")))
def test_a_form_for_issues_has_fields_with_labels(form):
    said = yaml.safe_load(form.read_text("utf-8"))
    if form.name == "config.yml":
        assert isinstance(said["blank_issues_enabled"], bool)
        return
    assert {"name", "description", "body"} <= set(said)
    ids = [field["id"] for field in said["body"]]
    assert len(set(ids)) == len(ids)
    assert all(field["attributes"]["label"] for field in said["body"])


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> tuple[Path, Path]:
    """A source distribution, and the wheel that is built of it."""
    folder = tmp_path_factory.mktemp("dist")
    # The build leaves files beside the sources while it runs, which other tests would find.
    copy = folder / "copy"
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(*LEFT_OUT))
    run([sys.executable, "-m", "build", "--outdir", str(folder), str(copy)], folder)
    (source,), (wheel,) = folder.glob("*.tar.gz"), folder.glob("*.whl")
    return source, wheel


def run(command: list[str], folder: Path) -> str:
    """What a command prints in a folder, without this checkout on Python's path."""
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "COLUMNS")}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}{done.stderr[-4000:]}"
    return done.stdout


@pytest.mark.exhaustive
def test_the_source_distribution_has_the_tests_and_the_documentation(built):
    with tarfile.open(built[0]) as file:
        names = {name.partition("/")[2] for name in file.getnames()}
    assert {"Makefile", "mkdocs.yml", "CITATION.cff", "docs/tutorial.md"} <= names
    assert "tests/test_release.py" in names
    assert not any(name.startswith(("build/", ".venv/")) for name in names)


@pytest.mark.exhaustive
def test_the_wheel_has_every_file_of_the_package(built):
    with zipfile.ZipFile(built[1]) as file:
        names = set(file.namelist())
    there = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "fabricusd").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert there - names == set()


@pytest.mark.exhaustive
@pytest.mark.parametrize("kind", ["source", "wheel"])
def test_what_is_built_works_in_a_clean_environment(built, kind, tmp_path):
    file = built[("source", "wheel").index(kind)]
    run([sys.executable, "-m", "venv", "clean"], tmp_path)
    folder = tmp_path / "clean" / ("Scripts" if sys.platform == "win32" else "bin")
    run([str(folder / "python"), "-m", "pip", "install", "--quiet", f"{file}[usd]"], tmp_path)
    command = str(folder / "fabricusd")
    version = run([command, "--version"], tmp_path).split()[1]
    assert version in file.name
    run([command, "samples", "."], tmp_path)
    run([command, "new", "--preset", "denim", "-o", "denim.usda"], tmp_path)
    assert "twill 3/1" in run([command, "cat", "denim.usda"], tmp_path)
    run([command, "check", "denim.usda"], tmp_path)

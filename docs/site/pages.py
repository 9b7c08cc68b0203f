"""Pages of the site that lie outside `docs`: the front page and what stands beside it.

MkDocs reads one folder. Links in the repository also lead to README.md, to scripts and to sources;
each file that a page links to gets a place on the site, and the link leads there.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
FRONT = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
}
"""Pages of the repository's root, and what they are called on the site."""

LINK = re.compile(r"(\]\()([^)\s]+)(\))")
FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add the decisions to the navigation, in their order."""
    for entry in config.nav or []:
        if "Decisions" in entry:
            pages = sorted((ROOT / "docs" / "decisions").glob("[0-9]*.md"))
            entry["Decisions"] = [
                "decisions/README.md", *(f"decisions/{page.name}" for page in pages)
            ]  # fmt: skip
    return config


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Give the pages of the root, and the files that pages link to, their places."""
    for source, target in FRONT.items():
        if (ROOT / source).exists():
            text = (ROOT / source).read_text("utf-8")
            files.append(File.generated(config, target, content=text))
    for page in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]:
        for _, link, _ in LINK.findall(FENCE.sub("", page.read_text("utf-8"))):
            path = _path(page.parent, link)
            target = _place(path) if path else None
            if target and target.startswith("source/") and target not in files.src_uris:
                content = (ROOT / str(path)).read_text("utf-8")
                files.append(File.generated(config, target, content=content))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links lead to the places of `on_files`."""
    here = page.file.src_uri
    sources = {target: source for source, target in FRONT.items()}
    folder = (ROOT / sources[here] if here in sources else ROOT / "docs" / here).parent

    def mended(match: re.Match[str]) -> str:
        path = _path(folder, match[2])
        if not path:
            return match[0]
        place = _place(path)
        _, mark, anchor = match[2].partition("#")
        there = posixpath.relpath(place, posixpath.dirname(here) or ".")
        return f"{match[1]}{there}{mark}{anchor}{match[3]}"

    return LINK.sub(mended, markdown)


def _path(folder: Path, link: str) -> str | None:
    """The file that `link` names, relative to the repository; None for the web and for anchors."""
    path = link.partition("#")[0]
    if not path or ":" in path:
        return None
    full = (folder / path).resolve()
    return full.relative_to(ROOT).as_posix() if full.is_relative_to(ROOT) else None


def _place(path: str) -> str:
    """Where the file `path` of the repository lies on the site."""
    if path in FRONT:
        return FRONT[path]
    if path.startswith("docs/") and not path.endswith(".py"):
        return path.removeprefix("docs/")
    return f"source/{path}.txt"

"""The gallery shows every preset, beside its command."""

from __future__ import annotations

from pathlib import Path

from fabricusd.schema import preset_names

DOCS = Path(__file__).resolve().parents[2] / "docs"
MOST_BYTES = 6e6


def test_every_preset_has_a_strip_and_its_command():
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    strips = sorted((DOCS / "images" / "gallery").iterdir())
    assert [strip.stem for strip in strips] == preset_names()
    for strip in strips:
        assert f"![{strip.stem}](images/gallery/{strip.name})" in text
        assert f"    fabricusd new --preset {strip.stem} -o {strip.stem}.usda\n" in text
    assert sum(strip.stat().st_size for strip in strips) < MOST_BYTES

"""Knits that are asked for by name."""

from __future__ import annotations

import pytest

from fabricusd.schema import preset_names
from fabricusd.weaves.knits import KNITS, knitted


@pytest.mark.parametrize("name", ["jersey", "Cotton-Jersey", "single jersey", "piqué", "knits"])
def test_a_knit_is_known_however_it_is_written(name: str) -> None:
    assert knitted(name).startswith("is knitted, not woven")


@pytest.mark.parametrize("name", ["ribbon", "cotton_poplin", "terry", "caribou", ""])
def test_other_names_are_no_knits(name: str) -> None:
    assert knitted(name) == ""


def test_what_is_near_is_a_preset() -> None:
    assert set(KNITS.values()) <= set(preset_names())


def test_no_preset_is_named_like_a_knit() -> None:
    assert not [name for name in preset_names() if knitted(name)]

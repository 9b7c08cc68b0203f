"""The table of known mixtures, and the cache."""

from __future__ import annotations

from dataclasses import replace

import pytest
from materials.lobes.mixtures import GAUSSIAN, mixture

from fabricusd.fabric import Fabric
from fabricusd.geometry.nearest import scaled
from fabricusd.materials.lobes import known
from fabricusd.materials.lobes.__main__ import PUBLISHED
from fabricusd.materials.lobes.fit import Fits
from fabricusd.materials.lobes.judge import Judge
from fabricusd.materials.lobes.mixture import CYCLES, FORMS, MATERIALX, Mixture
from fabricusd.schema import load


@pytest.mark.parametrize("name", PUBLISHED)
def test_every_published_preset_is_in_the_table(name):
    row = known.find(load(name))
    assert row is not None, "remake it: python -m fabricusd.materials.lobes --write"
    assert row["name"] == name
    for form in FORMS:
        held = [one for one in row["mixtures"] if one["form"] == form]
        assert 4 in [known.from_dict(one).count for one in held]


def test_every_mixture_of_the_table_can_be_read():
    for row in known.read_rows():
        assert [known.from_dict(one).form for one in row["mixtures"]] == list(FORMS)


def test_a_fabric_is_known_by_its_look_and_not_by_its_name():
    fabric = replace(load("linen_plain"), name="Renamed", documentation="another")
    assert known.find(fabric) is not None


def test_a_fabric_of_another_colour_is_not_known():
    assert known.find(scaled(load("linen_plain"), 1.05)) is None


def test_a_mixture_is_read_as_it_was_written(tmp_path):
    row = known.row_of("linen", load("linen_plain"), [mixture(CYCLES)])
    known.add_rows([row], tmp_path / "known.json")
    known.add_rows([row | {"law": "other"}], tmp_path / "known.json")
    known.add_rows([row], tmp_path / "known.json")
    held = known.read_rows(tmp_path / "known.json")
    assert [one["law"] for one in held] == sorted(["other", load("linen_plain").surface_law])
    assert known.from_dict(held[0]["mixtures"][0]) == mixture(CYCLES)


def test_a_fabric_that_is_not_in_the_table_is_fitted_once(tmp_path, monkeypatch):
    monkeypatch.setenv("FABRICUSD_CACHE_DIR", str(tmp_path))
    calls = []

    def fake(fabric: Fabric, count: int, *, max_error: float | None):
        calls.append(count)
        return Fits(mixture(CYCLES, GAUSSIAN), mixture(CYCLES))

    begun = []

    def fake_refit(fabric: Fabric, *first: Mixture):
        begun.append(first)
        return first[-1]

    monkeypatch.setattr(known, "fits", fake)
    monkeypatch.setattr(known, "refit", fake_refit)
    fabric = scaled(load("linen_plain"), 1.3)
    said: list[str] = []
    for _ in range(2):
        found = known.mixture_of(fabric, 3, progress=said.append)
        assert found == mixture(CYCLES, GAUSSIAN)
        # The form of MaterialX, which has GGX alone, starts from the best and from that of GGX.
        other = known.mixture_of(fabric, 3, MATERIALX, progress=said.append)
        assert other == known.in_form(mixture(CYCLES), MATERIALX)
    assert calls == [3]
    both = mixture(CYCLES, GAUSSIAN), mixture(CYCLES)
    assert begun == [tuple(known.in_form(one, MATERIALX) for one in both)]
    assert not any(lobe.gaussian for one in begun[0] for lobe in one.lobes)
    assert said == ["fitting 3 lobes to linen_plain"]


def test_the_table_is_near_the_cloth():
    fabric = load("linen_plain")
    judge = Judge(fabric)
    # Laws that do not mask light are harder for lobes that do.
    most = 1.6 if fabric.surface_law == "masked" else 3.3
    for form in (CYCLES, MATERIALX):
        found = judge(known.mixture_of(fabric, 4, form))
        assert found.delta_e < most
        assert max(found.sky_delta_e.values()) < 2.5


def test_the_judge_sees_a_mixture_of_another_cloth():
    other = known.mixture_of(load("silk_shot"), 4, CYCLES)
    assert Judge(load("linen_plain"))(other).delta_e > 10.0

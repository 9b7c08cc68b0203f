"""The shipped tables: all there, remade within their errors, small."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.geometry import reflectance, tubes
from fabricusd.geometry import tables as tables_module
from fabricusd.geometry.judge import judge
from fabricusd.geometry.tables import directions, main, table, table_names
from fabricusd.schema import load, published_names

WITHOUT = {"polyester_satin_charmeuse_back"}


def test_every_preset_with_a_geometry_has_a_table() -> None:
    assert set(table_names()) == set(published_names()) - WITHOUT


def test_tables_are_small() -> None:
    for path in (resources.files("fabricusd.geometry") / "data").iterdir():
        assert len(path.read_bytes()) < 50_000


def test_an_unknown_table_is_refused_with_those_that_are_there() -> None:
    with pytest.raises(FabricError, match="no table of 'tweed'; there are linen_plain"):
        table("tweed")


@pytest.mark.parametrize("name", ["linen_plain", "polyester_satin_charmeuse"])
def test_entries_traced_anew_agree_within_their_errors(name: str) -> None:
    found = table(name)
    some = np.arange(0, len(found.wi), 9)
    anew = reflectance(tubes(load(name)), found.wo[some], found.wi[some], count=1 << 13, seed=77)
    error = np.hypot(anew.error, found.error[some]) + 1e-6 + 1e-3 * found.value[some]
    off = np.abs(anew.value - found.value[some]) / error
    # Errors from 8 batches have a t distribution with 7 degrees of freedom: 6 of them in 1e3.
    assert off.max() < 6
    assert np.median(off) < 1.5
    wrong = np.abs(1.1 * anew.value - found.value[some]) / error
    assert wrong.max() > 6


def test_tables_hold_the_directions_that_they_say() -> None:
    wi, wo, held_out = directions()
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1, atol=1e-12)
    elevation = np.degrees(np.arcsin(wi[2::3, 2]))
    assert (elevation.min(), elevation.max()) == (pytest.approx(3, abs=1), pytest.approx(15, abs=1))
    assert held_out.sum() == len(wi) // 3
    for sort in range(3):
        assert held_out[sort::3].sum() == len(wi) // 9
    found = table("linen_plain")
    np.testing.assert_allclose(found.wi, wi, atol=1e-6)
    np.testing.assert_allclose(found.wo, wo, atol=1e-6)


def test_a_law_that_is_the_tubes_is_judged_right_and_others_by_how_far_they_are() -> None:
    found = table("linen_plain")
    value = found.value.astype(np.float64)
    same = judge(found, value)
    assert (same.error, same.bias, same.delta_e) == (0, 0, 0)
    half = judge(found, 0.5 * value)
    assert (half.error, half.bias) == (pytest.approx(0.5), pytest.approx(-0.5))
    assert half.delta_e > 5
    assert 0 < same.noise < 0.01
    with pytest.raises(FabricError, match="value has shape"):
        judge(found, value[1:])


def test_the_command_makes_a_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("COUNT", "FEWER", "SKY_COUNT"):
        monkeypatch.setattr(tables_module, name, 64)
    assert (
        main(["--only", "linen_plain", "polyester_satin_charmeuse_back", "-o", str(tmp_path)]) == 0
    )
    assert [p.name for p in tmp_path.iterdir()] == ["linen_plain.npz"]
    with np.load(tmp_path / "linen_plain.npz") as data:
        assert data["value"].shape == table("linen_plain").value.shape


def test_conserving_shares_leave_out_nothing_but_what_threads_absorb() -> None:
    found = table("linen_plain")
    total = found.up + found.down + found.gap[:, None] + found.lost
    assert (total[:, 0] <= 1 + 4 * found.shares_error[:, 0]).all()
    assert (np.diff(total, axis=1) < 0).all()
    # One scattering is part of all of them.
    assert (found.once_up <= found.up + 1e-6).all()
    assert (found.once_down <= found.down + 1e-6).all()

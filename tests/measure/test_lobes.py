"""Tables of lobes: read as written, and refused with the place where they are broken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.measure import read_lobes, write_lobes
from fabricusd.measure.lobes import gaps
from tests.measure.shoots import SPUN, lobes_of

LINE = "15,-20,0,.1,.2,.3,.01,.01,.01"
HEADER = "theta_i,theta_o,phi_d,f_r,f_g,f_b,sigma_r,sigma_g,sigma_b"


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_a_table_is_read_as_it_was_written(suffix, tmp_path):
    before = replace(lobes_of(SPUN, "half"), absolute=False, notes=("one, two", "three"))
    write_lobes(before, tmp_path / f"a{suffix}")
    after = read_lobes(tmp_path / f"a{suffix}")
    for name in ("theta_i", "theta_o", "phi_d", "f", "sigma"):
        np.testing.assert_allclose(
            getattr(after, name), getattr(before, name), rtol=2e-6, atol=1e-9
        )
    assert (after.absolute, after.name, after.notes) == (False, "made", ("one, two", "three"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        ("# nothing\n", "holds no table"),
        ("theta_i,theta_o,f_r\n1,2,3\n", "lacks the column(s) phi_d, f_g, f_b"),
        (f"{HEADER}\n", "holds no views"),
        (f"{HEADER}\n{LINE}\n15,-20,0,nan,.2,.3,.01,.01,.01\n", "line 3 has 'nan' for f_r"),
        (f"{HEADER}\n{LINE}\n15,-20,0,.1,.2,,.01,.01,.01\n", "line 3 has '' for f_b"),
        (f"{HEADER}\n15,-20,0,inf,.2,.3,.01,.01,.01\n", "line 2 has 'inf' for f_r"),
        (f"{HEADER}\n15,x,0,.1,.2,.3,.01,.01,.01\n", "line 2 has 'x' for theta_o"),
        (f"{HEADER}\n15,-20,0,.1,.2\n", "line 2 has 5 fields; it must have 9"),
        (f"{HEADER}\n15,-20,0,.1,.2,.3,0,.01,.01\n", "line 2 has a sigma that is not above 0"),
        (f"{HEADER}\n95,-20,0,.1,.2,.3,.01,.01,.01\n", "95 and -20 degrees; they must be from -90"),
    ],
)  # fmt: skip
def test_a_broken_table_is_refused_with_its_line(text, said, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(FabricError) as error:
        read_lobes(path)
    assert said in str(error.value)
    assert str(path) in str(error.value)


def test_columns_may_come_in_any_order_and_without_deviations(tmp_path):
    path = tmp_path / "mine.csv"
    path.write_text("f_b,phi_d,theta_o,theta_i,f_r,f_g,remark\n.3,-30,20,10,.1,.2,mirror\n")
    lobes = read_lobes(path)
    np.testing.assert_allclose(np.degrees([lobes.theta_i[0], lobes.theta_o[0]]), [10, 20])
    np.testing.assert_allclose(np.degrees(lobes.phi_d), [30])
    np.testing.assert_allclose(lobes.f, [[0.1, 0.2, 0.3]])
    assert "states no sigma" in lobes.notes[-1]
    assert lobes.name == "mine"


def test_a_stretch_without_views_is_a_gap_and_the_place_of_the_light_is_none():
    whole = lobes_of(SPUN)
    assert list(gaps(whole)) == []
    low, high = np.radians(-31), np.radians(-11)
    holed = whole.of(~((whole.theta_o > low) & (whole.theta_o < high) & (whole.theta_i < 0.1)))
    (said,) = gaps(holed)
    assert said == (
        "incidence 0, azimuth 0: there are no views between theta_o -34 and -10 degrees"
    )


def test_a_name_without_a_known_suffix_is_refused_and_nothing_is_written(tmp_path):
    with pytest.raises(FabricError, match=r"must end in \.csv or \.npz"):
        write_lobes(lobes_of(SPUN), tmp_path / "a.txt")
    assert list(tmp_path.iterdir()) == []

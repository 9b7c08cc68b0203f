"""Plots: every one that the lobes have views for, the same each time; a line without matplotlib."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.images.files import read_image
from fabricusd.measure import fit_thread
from fabricusd.measure.plots.draw import draw_all
from fabricusd.measure.plots.hemispheres import SIDE, _hemisphere
from tests.measure.shoots import SPUN, lobes_of


@pytest.mark.parametrize(
    ("design", "names"),
    [("coarse", {"polar", "incidence_plane"}),
     ("half", {"polar", "incidence_plane", "hemispheres"})],
)  # fmt: skip
def test_the_plots_that_the_views_allow_are_drawn(design, names, tmp_path):
    pytest.importorskip("matplotlib")
    lobes = lobes_of(SPUN, design)
    if design == "half":
        lobes = lobes.of(np.degrees(lobes.theta_i).round() == 48)
    fit = fit_thread(lobes, "microcylinder")
    written = draw_all(lobes, fit, tmp_path / "plots")
    assert {p.stem for p in written} == names
    assert {p.suffix for p in written} == {".png", ".svg"}
    for path in written:
        assert path.stat().st_size > 5000
        if path.suffix == ".png":
            assert read_image(path).std() > 0.02
    if design == "half":
        again = draw_all(lobes, fit, tmp_path / "again")
        assert [p.read_bytes() for p in again] == [p.read_bytes() for p in written]


def test_without_matplotlib_one_line_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    lobes = lobes_of(SPUN, "coarse")
    fit = fit_thread(lobes, "microcylinder")
    with pytest.raises(FabricError, match=r"pip install 'fabricusd\[docs\]'"):
        draw_all(lobes, fit, tmp_path / "plots")
    assert not (tmp_path / "plots").exists()


def test_a_folder_for_plots_must_not_be_a_file(tmp_path):
    pytest.importorskip("matplotlib")
    (tmp_path / "plots").write_text("")
    lobes = lobes_of(SPUN, "coarse")
    with pytest.raises(FabricError, match="is a file; it must be a folder"):
        draw_all(lobes, fit_thread(lobes, "microcylinder"), tmp_path / "plots")


def test_the_hemispheres_together_are_all_azimuths():
    for forward, low, high in ((False, 0.0, np.pi / 2), (True, np.pi / 2, np.pi)):
        theta, phi, inside = _hemisphere(forward)
        assert theta.shape == phi.shape == (SIDE * SIDE,)
        seen = phi[inside.ravel()]
        assert low - 1e-9 <= seen.min() < low + 0.1
        assert high - 0.1 < seen.max() <= high + 1e-9
    assert np.degrees(theta[inside.ravel()]).max() > 80

"""Bands: widths that cover exactly what each set covers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.bands import band_areas, band_widths, seen_length
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.fabric import Fabric
from fabricusd.schema import load, preset_names
from tests.strategies import fabrics


def seen_by_counting(fabric: Fabric, places: int = 4001) -> np.ndarray:
    """(2,) shares of the cloth on which each set is seen, by looking at points of every cell."""
    x = coverage(fabric).width
    grid = fabric.weave.cells
    at = np.abs((np.arange(places) + 0.5) / places - 0.5)
    in_warp, in_weft = at < 0.5 * x[WARP], at < 0.5 * x[WEFT]
    both = in_warp.mean() * in_weft.mean()
    warp = in_warp.mean() * (1 - in_weft.mean()) + both * grid.mean()
    weft = in_weft.mean() * (1 - in_warp.mean()) + both * (1 - grid.mean())
    found = np.zeros(2)
    found[[WEFT, WARP]] = weft, warp
    return found


@pytest.mark.parametrize("name", preset_names())
def test_bands_of_a_preset_cover_what_it_states(name: str) -> None:
    fabric = load(name)
    found = coverage(fabric)
    stated = [s.coverage for s in (fabric.weft, fabric.warp)]
    np.testing.assert_allclose(found.area, stated, atol=1e-12)
    np.testing.assert_allclose(seen_by_counting(fabric), found.area, atol=2e-3)


@pytest.mark.parametrize(
    ("name", "weft", "warp", "gap"),
    [
        ("linen_plain", 0.417, 0.417, 0.34),
        ("polyester_satin_charmeuse", 0.5, 1.0, 0.0),
        ("silk_crepe_de_chine", 1.0, 0.5, 0.0),
        ("silk_shot", 1.0, 0.28, 0.0),
    ],
)
def test_widths_of_the_published_fabrics(name: str, weft: float, warp: float, gap: float) -> None:
    found = coverage(load(name))
    np.testing.assert_allclose(found.width, (weft, warp), atol=1e-3)
    assert found.gap == pytest.approx(gap, abs=1e-9)


@given(fabrics())
def test_every_fabric_has_bands_that_cover_what_it_states(fabric: Fabric) -> None:
    found = coverage(fabric)
    for area, thread_set in zip(found.area, (fabric.weft, fabric.warp), strict=True):
        # The square root of a difference near 0 keeps half the digits, where the two widths meet
        # in a cloth without a gap.
        if thread_set.coverage is not None:
            assert area == pytest.approx(thread_set.coverage, abs=1e-7)
    assert (found.width >= 0).all()
    assert (found.width <= 1).all()
    np.testing.assert_allclose(found.type_area.sum(axis=1), found.area, atol=1e-12)


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))
def test_widths_solve_their_equations_for_every_cells_and_areas(
    warp_cells: float, covered: float, share: float
) -> None:
    cells = np.array([1 - warp_cells, warp_cells])
    area = covered * np.array([share, 1 - share])
    x = band_widths(cells, area)
    shown = band_areas(cells, x)
    np.testing.assert_allclose(shown, area, atol=1e-7)
    assert ((x >= 0) & (x <= 1)).all()


def test_areas_beyond_the_cloth_take_the_nearest_widths_and_say_so() -> None:
    cells, area = np.array([0.5, 0.5]), np.array([0.6, 0.6])
    x = band_widths(cells, area)
    assert ((x >= 0) & (x <= 1)).all()
    shown = band_areas(cells, x)
    assert shown.sum() == pytest.approx(1.0, abs=0.25)
    assert np.abs(shown - area).max() > 0.05


def test_a_run_is_seen_from_edge_to_edge_of_the_threads_that_cross_over_it() -> None:
    linen = coverage(load("linen_plain"))
    assert seen_length(1, float(linen.width[WEFT])) == pytest.approx(1.583, abs=1e-3)
    assert seen_length(4, 1.0) == 4.0

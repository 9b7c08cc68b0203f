"""The conserving law place by place: the mean over the repeat is the repeat, gaps included."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance import plain
from fabricusd.appearance.conserving import levels, multiple
from fabricusd.appearance.weave.place import Place
from fabricusd.sides import Sides
from tests.appearance.presets import PRESETS, with_model


def _view(degrees, azimuth):
    theta, phi = math.radians(degrees), math.radians(azimuth)
    s = math.sin(theta)
    return np.array([s * math.cos(phi), s * math.sin(phi), math.cos(theta)])


@pytest.mark.parametrize("across", [False, True], ids=["weave", "thread"])
@pytest.mark.parametrize("degrees", [0, 45, 70, 85])
@pytest.mark.parametrize("name", ["linen_plain", "polyester_satin_charmeuse", "velvet"])
def test_the_mean_over_places_and_what_passes_them_is_the_repeat(name, degrees, across):
    # At linen's gap of .34 from above, all of it passes; at 85 degrees nothing does. The satin has
    # no gap, and passes nothing anywhere unless its fabric states what passes.
    fabric = plain.white(with_model(PRESETS[name], "conserving"))
    if name == "polyester_satin_charmeuse":
        fabric = replace(fabric, sides=Sides(gap=(0.13,)))
    tables = multiple.conserving_tables(fabric)
    wi, wo = _view(80, 20), _view(degrees, 110)
    real = np.float64
    x, w = np.polynomial.legendre.leggauss(24)
    total, passes = np.zeros(3), 0.0
    for k, (c, s, weight) in enumerate(tables.nodes):
        area = weight * max(c, math.cos(math.radians(85)))
        psi0, is_warp = math.atan2(s, c), int(k >= tables.warp_start)
        passes += area * levels.passing(real, tables, False, *wo)
        for at, share in zip(x, w, strict=True) if across else ((0.0, 2.0),):
            place = Place(is_warp, tables.node_thread[k], psi0, at)
            value = levels.conserving_level_value(real, tables, across, place, *wi, *wo)
            total += area * 0.5 * share * np.array(value)
    gap = 1.0 - tables.covered
    passes += gap * levels.passing(real, tables, True, *wo)
    place = Place(2, 0, 0.0, 0.0)
    total += gap * np.array(levels.conserving_level_value(real, tables, across, place, *wi, *wo))
    assert passes == pytest.approx(levels.gap_towards(real, tables, *wo), abs=1e-12)
    want = multiple.conserving_value(real, tables, *wi, *wo)
    np.testing.assert_allclose(total, want, rtol=1e-4 if across else 1e-10)


def test_a_gap_closes_before_threads_open():
    # Of linen, .34 is gap. Where more passes, all of the gap is open and the threads a little.
    fabric = with_model(PRESETS["linen_plain"], "conserving")
    up = _view(10, 0)
    for share, in_gap, on_thread in ((0.17, 0.5, 0.0), (0.34, 1.0, 0.0), (0.67, 1.0, 0.5)):
        tables = multiple.conserving_tables(replace(fabric, sides=Sides(gap=(share,))))
        assert levels.passing(np.float64, tables, True, *up) == pytest.approx(in_gap, abs=0.02)
        assert levels.passing(np.float64, tables, False, *up) == pytest.approx(on_thread, abs=0.02)


def test_opaque_cloth_passes_what_its_gap_is_from_every_direction():
    fabric = replace(with_model(PRESETS["linen_plain"], "conserving"), opaque=True)
    tables = multiple.conserving_tables(fabric)
    for degrees in (0, 60, 85):
        view = _view(degrees, 30)
        assert levels.gap_towards(np.float64, tables, *view) == pytest.approx(1 - tables.covered)

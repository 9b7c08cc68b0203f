"""Pile as tufts: as long as their arcs, over their runs, on a backing that lets nothing through."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.errors import FabricError
from fabricusd.geometry import albedo, reflectance, seen, tubes
from fabricusd.schema import load

UP = (0.0, 0.0, 1.0)


def test_tufts_rise_as_their_curves_say() -> None:
    fabric = load("velvet")
    cloth = tubes(fabric)
    weft = next(ln for ln in cloth.repeat.lines if ln.which == WEFT)
    warp = next(ln for ln in cloth.repeat.lines if ln.which == WARP)
    # The weft's is cut at its highest point, the warp's comes down again.
    assert weft.height.argmax() == len(weft.height) - 1
    assert warp.height[-1] == pytest.approx(0.0, abs=1e-6)
    assert warp.height.argmax() == pytest.approx(len(warp.height) / 2, abs=1)
    # From -90 to -50 degrees: rise over reach is the ratio of the mean sine to the mean cosine.
    a, b = np.radians((-90.0, -50.0))
    ratio = (np.cos(b) - np.cos(a)) / (np.sin(b) - np.sin(a))
    reach = fabric.warp.pitch - weft.half_height * (1 + np.sin(-b))
    assert weft.height[-1] == pytest.approx(ratio * reach, rel=1e-3)


def test_each_cell_shows_the_tuft_that_stands_in_it() -> None:
    fabric = load("velvet")
    uv = np.random.default_rng(1).random((4000, 2)) * 2
    found = seen(tubes(fabric), uv)
    cell = np.floor(uv).astype(int)
    top = np.where(fabric.weave.cells[cell[:, 0], cell[:, 1]], WARP, WEFT)
    threads = found.number >= 0
    assert threads.mean() > 0.85
    assert (found.set == top)[threads].mean() >= 0.98


def test_no_light_passes_the_backing() -> None:
    threads = {
        n: replace(t, albedo=(1.0,) * 3, surface_gain=0.0, isotropic=1.0)
        for n, t in load("velvet").threads.items()
    }
    fabric = replace(load("velvet"), threads=threads, model="conserving")
    shares = albedo(tubes(fabric), [UP, (0.6, 0.0, 0.8)], count=1 << 13)
    assert shares.transmitted.max() < 1e-3
    assert shares.gap.max() == 0.0
    # What is not seen again has ended on the backing.
    np.testing.assert_allclose(shares.total, 1.0, atol=0.05)
    assert (shares.reflected > 0.02).all()


def test_light_from_below_does_not_arrive() -> None:
    cloth = tubes(load("velvet"))
    assert (reflectance(cloth, UP, (0.6, 0.0, -0.8), count=1 << 12).value < 1e-6).all()


def test_the_back_of_opaque_cloth_is_refused() -> None:
    with pytest.raises(FabricError, match="is opaque"):
        reflectance(tubes(load("velvet")), (0.0, 0.0, -1.0), UP, count=64)


def test_pile_without_a_backing_is_refused() -> None:
    with pytest.raises(FabricError, match="is pile in a cloth that is not all pile"):
        tubes(replace(load("velvet"), opaque=False))

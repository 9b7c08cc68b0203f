"""The fuzz of the law against fibres that stand off tubes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance.fuzz import bald, optical_depth
from fabricusd.appearance.surface import evaluate
from fabricusd.errors import FabricError
from fabricusd.geometry import fibres, paths, tubes
from fabricusd.schema import load
from tests.appearance.test_fuzz import directions, hairy, white_sky


def test_cloth_without_hairiness_has_no_fibres() -> None:
    with pytest.raises(FabricError, match="no fibres"):
        fibres.hairy_tubes(load("thread_linen_spun"), (4, 4))


def test_the_fibres_are_as_many_as_the_hairiness_says() -> None:
    fabric = hairy(load("denim"), 3.0)
    traced = fibres.hairy_tubes(fabric, (12, 12))
    assert traced.depth == pytest.approx(optical_depth(fabric), rel=0.02)


def test_white_fibres_on_white_tubes_lose_no_light() -> None:
    fabric = hairy(load("cotton_poplin"), 4.0)
    threads = {n: replace(t, albedo=(1.0,) * 3) for n, t in fabric.threads.items()}
    traced = fibres.hairy_tubes(replace(fabric, threads=threads), (12, 12))
    found = fibres.white_sky(traced, directions(6, 1, 70), count=1 << 13)
    assert found.sum(axis=1).mean() == pytest.approx(1.0, abs=0.015)


@pytest.mark.exhaustive
def test_albedo_at_grazing_views_changes_as_that_of_tubes_with_fibres() -> None:
    fabric = hairy(load("cotton_poplin"), 4.0)
    degrees = (0, 75, 83)
    mu = np.cos(np.radians(degrees))
    wo = np.stack((0.8 * np.sqrt(1 - mu * mu), 0.6 * np.sqrt(1 - mu * mu), mu), axis=-1)
    with_fibres = fibres.white_sky(fibres.hairy_tubes(fabric, (24, 24)), wo, count=1 << 17)[:, 0, 1]
    without = paths.albedo(tubes(bald(fabric)), wo, count=1 << 17).reflected[:, 1]
    true = with_fibres - without
    law = [
        float((white_sky(fabric, float(m)) - white_sky(bald(fabric), float(m)))[0, 1]) for m in mu
    ]
    assert law[0] == pytest.approx(true[0], abs=0.015)
    assert law[1] == pytest.approx(true[1], abs=0.025)
    assert law[2] == pytest.approx(true[2], abs=0.04)
    # That the comparison can fail.
    assert true[1] > 0.035
    assert true[2] > 0.08


@pytest.mark.exhaustive
def test_dark_cloth_is_nearer_to_tubes_with_fibres_with_its_fuzz() -> None:
    fabric = hairy(load("denim"), 3.0)
    wi, wo = directions(60, 2, 80), directions(60, 3, 80)
    true = fibres.reflectance(fibres.hairy_tubes(fabric, (24, 24)), wo, wi, count=1 << 12).value
    error = {
        name: float(np.abs(evaluate(f, wi, wo) - true)[:, 1].mean() / true[:, 1].mean())
        for name, f in (("with", fabric), ("without", bald(fabric)))
    }
    assert error["with"] < 0.06
    assert error["without"] > 1.7 * error["with"]


def test_fibres_point_up() -> None:
    fabric = hairy(load("cotton_poplin"), 0.5)
    traced = fibres.hairy_tubes(fabric, (4, 4))
    field = traced.field
    assert np.allclose(np.linalg.norm(field.axis, axis=1), 1)
    assert (field.axis[:, 2] >= 0).all()

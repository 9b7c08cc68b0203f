"""What passes between the threads, as paths and shadow rays are told."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit

from fabricusd.appearance.conserving.by_side import by_side
from fabricusd.appearance.conserving.grid import entry_angles
from fabricusd.appearance.law import CONSERVING_ONLY, surface_law
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.weave.compiled import compile_fabric
from fabricusd.appearance.weave.coverage import GAP, coverage
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.kernels.real import LEAN
from fabricusd.reference.rays.triangles import RECORD, N, T
from fabricusd.reference.surfaces.fabric_gap import (
    TABLE,
    gap_along,
    gap_table,
    pass_gaps,
    pass_published,
)
from fabricusd.schema import load

LINEN = load("linen_plain")


def _law(gap):
    return SimpleNamespace(kind=CONSERVING_ONLY, conserving=SimpleNamespace(gap=gap))


@njit(**LEAN)
def _along(gap, record, u, v, rays, out):
    for k in range(len(rays)):
        out[k] = gap_along(gap, record, u, v, rays[k, 0], rays[k, 1], rays[k, 2])


def test_a_shadow_ray_meets_the_gap_of_its_direction_in_the_smooth_frame():
    gap = by_side(LINEN, *entry_angles(*TABLE)).gap.astype(np.float32)
    normal, along = np.array([0.48, 0.6, 0.64]), np.array([0.8, 0.0, -0.6])
    record = np.zeros(RECORD, np.float32)
    for corner in range(3):
        # Of any length, and the direction of u not perpendicular to the normal.
        record[N + 3 * corner : N + 3 * corner + 3] = 1.7 * normal
        record[T + 3 * corner : T + 3 * corner + 3] = 0.4 * (along + 0.3 * normal)
    rays = np.random.default_rng(3).standard_normal((400, 3)).astype(np.float32)
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    out = np.empty(len(rays), np.float32)
    _along(gap, record, np.float32(0.2), np.float32(0.5), rays, out)
    theta = np.arccos(np.clip(np.abs(rays @ normal), 0, 1))
    phi = np.arctan2(rays @ np.cross(normal, along), rays @ along)
    np.testing.assert_allclose(out, by_side(LINEN, theta, phi).gap, atol=0.01)
    assert out.min() < 0.01 < 0.3 < out.max()


@pytest.mark.parametrize("name", ["linen_plain", "polyester_satin_charmeuse"])
def test_places_of_published_cloth_pass_what_the_repeat_passes(name):
    """Linen passes through its gaps alone; satin, which has none from above, everywhere alike."""
    fabric = load(name)
    tables = surface_law(fabric, shadow=compile_shadow(fabric)).published
    uv = np.random.default_rng(2).random((40_000, 2)) * 40
    sets = lookup(compile_fabric(fabric), uv).set
    polar = np.radians([0.0, 45.0, 75.0])
    wo = np.stack((np.sin(polar), 0 * polar, np.cos(polar))).astype(np.float32)
    whole = np.empty(3, np.float32)
    pass_published(np.float32, tables, np.float32(1), wo, whole)
    assert whole.max() > 0.1
    for k in range(3):
        out = np.empty(len(uv), np.float32)
        towards = np.repeat(wo[:, k : k + 1], len(uv), axis=1)
        pass_gaps(np.float32, tables, np.float32(1), sets, towards, out)
        assert out.mean() == pytest.approx(whole[k], abs=0.01)
        assert (out[sets != GAP] == out[sets != GAP][0]).all()
    # Towards the normal no thread lets light through.
    pass_gaps(np.float32, tables, np.float32(1), sets, np.repeat(wo[:, :1], len(uv), 1), out)
    assert out[sets != GAP].max() < 0.01


def test_cloth_that_passes_the_same_from_everywhere_or_nothing_has_no_table():
    gap = np.full(TABLE, 0.2)
    assert gap_table(_law(gap), opaque=False) == pytest.approx(gap)
    assert gap_table(_law(gap), opaque=True) is None
    # Laws that do not close gaps with the view: what passes is the gap, from everywhere.
    assert gap_table(surface_law(replace(LINEN, surface_law="masked")), opaque=False) is None
    assert gap_table(_law(0.0 * gap), opaque=False) is None
    # Pile has another table, of one number.
    assert gap_table(_law(np.full((25, 72), 0.2)), opaque=False) is None


def test_published_cloth_whose_gaps_close_with_the_view_has_its_openness():
    table = gap_table(surface_law(replace(LINEN, surface_law="projected")), opaque=False)
    assert table is not None
    assert table.shape == TABLE
    gap = coverage(LINEN).gap
    assert table.max() == pytest.approx(gap, abs=0.02)
    # Towards the horizon threads cover the gaps.
    assert table[-1].max() < 0.05 * gap

"""Rays through Embree, by its library and by embreex, against the intersection in NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.reference.rays import embree
from fabricusd.reference.rays.embree import (
    DX,
    DY,
    DZ,
    GEOMETRY,
    HIT_U,
    HIT_V,
    MISS,
    NGX,
    NGY,
    NGZ,
    OX,
    OY,
    OZ,
    PRIMITIVE,
    TFAR,
    TNEAR,
    Accelerator,
    new_packets,
)


@pytest.fixture(params=["library", "embreex"])
def accelerate(request, monkeypatch):
    if request.param == "embreex":
        monkeypatch.setattr(embree, "_LIBRARY", None)
    elif embree._LIBRARY is None:
        pytest.skip("embreex ships no library that can be called here")
    return Accelerator


def soup(count: int = 60) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    centre = rng.uniform(-1, 1, (count, 1, 3))
    points = (centre + rng.uniform(-0.3, 0.3, (count, 3, 3))).reshape(-1, 3).astype(np.float32)
    return points, np.arange(3 * count).reshape(-1, 3)


def rays(count: int, near: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    origin = rng.uniform(-2, 2, (count, 3)).astype(np.float32)
    direction = rng.normal(size=(count, 3))
    direction = (direction / np.linalg.norm(direction, axis=1)[:, None]).astype(np.float32)
    packets = new_packets(count)
    for k in range(count):
        p, lane = divmod(k, 16)
        packets[p, [OX, OY, OZ], lane] = origin[k]
        packets[p, [DX, DY, DZ], lane] = direction[k]
        packets[p, TNEAR, lane], packets[p, TFAR, lane] = near, 1e30
    packets.view(np.uint32)[:, GEOMETRY] = MISS
    return packets, origin, direction


def nearest(points, tri, origin, direction, near):
    """(distance, triangle, u, v) of each ray by [Moller1997], infinite where nothing is hit."""
    p = points[tri].astype(np.float64)
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    found = []
    for o, d in zip(origin.astype(np.float64), direction.astype(np.float64), strict=True):
        h = np.cross(d, e2)
        det = np.einsum("ij,ij->i", e1, h)
        s = o - p[:, 0]
        u = np.einsum("ij,ij->i", s, h) / det
        q = np.cross(s, e1)
        v = np.einsum("ij,j->i", q, d) / det
        t = np.einsum("ij,ij->i", e2, q) / det
        t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > near), t, np.inf)
        k = int(np.argmin(t))
        found.append((t[k], k, u[k], v[k]))
    return found


@pytest.mark.parametrize("coherent", [False, True])
@pytest.mark.parametrize("near", [0.0, 0.7])
def test_the_nearest_hit_is_that_of_the_formula(accelerate, near, coherent):
    points, tri = soup()
    packets, origin, direction = rays(333, near)
    accelerate(points, tri).intersect(packets, len(packets), coherent=coherent)
    whole = packets.view(np.uint32)
    hits = 0
    for k, (t, triangle, u, v) in enumerate(nearest(points, tri, origin, direction, near)):
        p, lane = divmod(k, 16)
        assert (whole[p, GEOMETRY, lane] != MISS) == np.isfinite(t)
        if np.isfinite(t):
            hits += 1
            assert whole[p, PRIMITIVE, lane] == triangle
            assert packets[p, [TFAR, HIT_U, HIT_V], lane] == pytest.approx([t, u, v], abs=2e-5)
    assert hits > 10


def test_the_normal_is_the_right_hand_one_of_the_corners(accelerate):
    points, tri = soup()
    packets, _, _ = rays(333)
    accelerate(points, tri).intersect(packets, len(packets))
    whole = packets.view(np.uint32)
    p, lane = np.nonzero(whole[:, GEOMETRY] != MISS)
    corners = points[tri[whole[p, PRIMITIVE, lane]]]
    expected = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = np.stack([packets[p, row, lane] for row in (NGX, NGY, NGZ)], axis=1)
    assert np.all(np.einsum("ij,ij->i", normal, expected) > 0)


def test_occlusion_is_a_hit_before_the_end(accelerate):
    points, tri = soup()
    packets, origin, direction = rays(333)
    packets[:, TFAR] = np.where(packets[:, TFAR] > 0, 1.0, -1.0)
    accelerate(points, tri).occluded(packets, len(packets))
    for k, (t, *_) in enumerate(nearest(points, tri, origin, direction, 0.0)):
        assert (packets[divmod(k, 16)[0], TFAR, k % 16] < 0) == (t < 1.0)


def test_lanes_that_are_padding_are_not_traced(accelerate):
    points, tri = soup()
    packets, _, _ = rays(5)
    before = packets.view(np.uint32)[0, :, 5:].copy()
    accelerate(points, tri).intersect(packets, 1)
    assert np.array_equal(packets.view(np.uint32)[0, :, 5:], before)


def test_nothing_to_hit_is_a_miss(accelerate):
    packets, _, _ = rays(16)
    accelerate(np.zeros((0, 3), np.float32), np.zeros((0, 3), int)).intersect(packets, 1)
    assert np.all(packets.view(np.uint32)[0, GEOMETRY] == MISS)


def test_a_device_says_which_embree_it_is(accelerate):
    assert accelerate(*soup()).version.lower().startswith("embree")

"""Rasterised triangles, shadow maps and shapes, against geometry done by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fabricusd.fabric import Fabric
from fabricusd.preview.kernels.raster import NOTHING, rasterise
from fabricusd.preview.occlusion import (
    DIRECTIONS,
    orthographic,
    shadow_map,
    sky_directions,
    visibility_of,
)
from fabricusd.preview.picture import _corners
from fabricusd.preview.shapes import SHAPES, SWATCH, WIDEST_SWATCH, swatch


def drawn(corners: np.ndarray, side: int = 32) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    depth = np.full((side, side), np.inf)
    triangle = np.full((side, side), NOTHING, np.int32)
    weights = np.zeros((side, side, 2), np.float32)
    rasterise(np.ascontiguousarray(corners, np.float64), 0.0, 0.0, depth, triangle, weights)
    return depth, triangle, weights


def test_a_pixel_is_covered_where_its_middle_is_inside():
    corners = np.array([[[4.0, 4, 1, 7], [24, 4, 1, 7], [4, 24, 1, 7]]])
    depth, triangle, _ = drawn(corners)
    y, x = np.mgrid[:32, :32] + 0.5
    inside = (x >= 4) & (y >= 4) & (x + y <= 28)
    assert np.array_equal(triangle == 0, inside)
    assert (depth[inside] == 7).all()


def test_both_windings_are_drawn_and_the_nearer_one_wins():
    near = np.array([[2.0, 2, 1, 1], [30, 2, 1, 1], [2, 30, 1, 1]])
    far = near[[0, 2, 1]] + [0, 0, 0, 1]
    for corners in (np.stack((near, far)), np.stack((far, near))):
        depth, _, _ = drawn(corners)
        assert depth[5, 5] == 1


def test_perspective_is_that_of_the_ray_through_a_pixel():
    rng = np.random.default_rng(0)
    camera = SHAPES["sphere"](Fabric()).camera()
    points = camera.frame[:3, 3] - camera.frame[:3, 2] * 0.4 + rng.normal(size=(1, 3, 3)) * 0.08
    corners = _corners(points, camera, (32, 32))
    _, triangle, weights = drawn(corners)
    for y, x in np.argwhere(triangle == 0)[::7]:
        b, c = weights[y, x]
        place = (1 - b - c) * points[0, 0] + b * points[0, 1] + c * points[0, 2]
        seen = _corners(place[None, None], camera, (32, 32))[0, 0]
        assert seen[:2] / seen[2] == pytest.approx([x + 0.5, y + 0.5], abs=1e-3)


def test_triangles_behind_the_camera_are_left_out():
    corners = np.array([[[4.0, 4, 1, 1], [24, 4, -1, 1], [4, 24, 1, 1]]])
    assert (drawn(corners)[1] == NOTHING).all()


def test_a_shadow_map_holds_the_first_surface():
    # Two squares one above the other: from above, the lower one is hidden.
    square = np.array([[[0.0, 0, 0], [1, 0, 0], [1, 0, 1]], [[0, 0, 0], [1, 0, 1], [0, 0, 1]]])
    points = np.concatenate((square, square + np.array([0.0, 0.5, 0.0])))
    up = np.array([0.0, 1.0, 0.0])
    matrix, depth = shadow_map(points, up, 64)
    middle = np.array([[0.5, 0.0, 0.5], [0.5, 0.5, 0.5]])
    at = middle @ matrix[:, :3].T + matrix[:, 3]
    x, y = at[0, :2].astype(int)
    assert depth[y, x] == pytest.approx(at[1, 2])
    assert at[0, 2] - at[1, 2] == pytest.approx(0.5)


def test_a_map_shows_every_point():
    shape = SHAPES["drape"](Fabric())
    for towards in sky_directions()[::9]:
        matrix = orthographic(shape.points, towards, 128)
        at = shape.points.reshape(-1, 3) @ matrix[:, :3].T + matrix[:, 3]
        assert at[:, :2].min() > 1.9
        assert at[:, :2].max() < 126.1


def test_the_sky_s_directions_are_even():
    sky = sky_directions()
    assert np.linalg.norm(sky, axis=1) == pytest.approx(np.ones(DIRECTIONS))
    assert np.abs(sky.mean(axis=0)).max() < 0.02
    assert sky.T @ sky / DIRECTIONS == pytest.approx(np.eye(3) / 3, abs=0.02)


def test_the_sky_reaches_all_of_a_sphere_and_not_all_of_a_drape():
    open_share = {}
    for name in ("sphere", "drape"):
        shape = SHAPES[name](Fabric())
        found = visibility_of(shape)
        normals = shape.normals.reshape(-1, 3)[found.first]
        above = normals @ sky_directions().T > 0.1
        open_share[name] = found.arrives[above].mean()
    assert open_share["sphere"] > 0.999
    assert 0.5 < open_share["drape"] < 0.95


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_have_normals_outside_and_a_grain_along_u(name):
    shape = SHAPES[name](Fabric())
    edges = shape.points[:, 1:] - shape.points[:, :1]
    face = np.cross(edges[:, 0], edges[:, 1])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    assert np.einsum("mk,mck->mc", face, shape.normals).min() > 0.9
    assert np.abs(np.einsum("mck,mck->mc", shape.normals, shape.tangents)).max() < 1e-9
    # Metres on the cloth are metres along u; on a sphere at the equator only.
    du = shape.metres[:, 1:, 0] - shape.metres[:, :1, 0]
    along = np.einsum("mek,mk->me", edges, shape.tangents.mean(axis=1))
    long = np.abs(du) > 1e-6
    if name == "sphere":
        long &= np.abs(shape.points[:, :1, 1]) < 0.005
    assert np.median(along[long] / du[long]) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("ends", "density", "side"),
    [(2, 2000.0, SWATCH), (60, 2000.0, 0.03), (4000, 2000.0, WIDEST_SWATCH)],
)
def test_a_swatch_shows_a_repeat(ends, density, side):
    from dataclasses import replace

    from fabricusd.fabric import ThreadSet, Weave

    cells = np.zeros((ends, 2), bool)
    cells[::2] = [True, False]
    fabric = replace(Fabric(), weave=Weave(cells), warp=ThreadSet(density=density))
    shape = swatch(fabric)
    assert np.ptp(shape.points[..., 0]) == pytest.approx(side)
    assert np.ptp(shape.metres[..., 0]) == pytest.approx(side)
    assert math.isclose(np.ptp(shape.points[..., 2]), 0.0)

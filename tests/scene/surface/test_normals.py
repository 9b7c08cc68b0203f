"""Normals of meshes that author none, against those of the shapes that the meshes stand for."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.scene.surface.normals import group_numbers, smooth_normals

AROUND = 48


def swept(profile, *, closed=False):
    """Points (radius, height) turned about y: points and triangles, the seam's points twice."""
    profile = np.asarray(profile, float)
    phi = np.linspace(0.0, 2 * np.pi, AROUND + 1)
    r, y = profile.T[:, :, None]
    points = np.stack([r * np.sin(phi), y + 0 * phi, r * np.cos(phi)], -1).reshape(-1, 3)
    i = np.arange(len(points)).reshape(len(profile), AROUND + 1)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    triangles = np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)])
    corners = points[triangles]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    return points, triangles[area > 1e-9]


def sphere():
    t = np.linspace(0, np.pi, 33)
    points, triangles = swept(np.stack([np.sin(t), -np.cos(t)], 1))
    corners = points[triangles]
    return points, triangles, corners, np.hypot(corners[..., 0], corners[..., 2]) > 0.05


def bowl():
    t = np.linspace(0.3, 0.45 * np.pi, 17)
    points, triangles = swept(np.stack([np.sin(t), -np.cos(t)], 1))
    corners = points[triangles]
    inner = (corners[..., 1] > -np.cos(0.32)) & (corners[..., 1] < -np.cos(0.44 * np.pi))
    return points, triangles, corners, inner


def cylinder():
    profile = [(0, -1), (1, -1), (1, -0.5), (1, 0.5), (1, 1), (0, 1)]
    points, triangles = swept(profile)
    corners = points[triangles]
    side = (np.ptp(corners[..., 1], axis=1) > 0.1)[:, None, None]
    across = corners * [1, 0, 1]
    return points, triangles, np.where(side, across, np.sign(corners) * [0, 1, 0]), True


def cone():
    points, triangles = swept([(0, -1), (1, -1), (0.6, 0), (0.2, 1)])
    corners = points[triangles]
    side = (np.ptp(corners[..., 1], axis=1) > 0.1)[:, None, None]
    across = corners * [1, 0, 1]
    slant = across / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
    truth = np.where(
        side, slant + np.array([0, 0.4, 0]), np.broadcast_to([0.0, -1, 0], corners.shape)
    )
    return points, triangles, truth, True


def torus():
    t = np.linspace(0, 2 * np.pi, 33)
    points, triangles = swept(np.stack([2 + 0.7 * np.cos(t), 0.7 * np.sin(t)], 1))
    corners = points[triangles]
    across = corners * [1, 0, 1]
    ring = 2 * across / np.linalg.norm(across, axis=-1, keepdims=True)
    return points, triangles, corners - ring, True


SHAPES = {"sphere": sphere, "bowl": bowl, "cylinder": cylinder, "cone": cone, "torus": torus}


def degrees_off(points, triangles, truth, counted):
    normals = smooth_normals(points.astype(np.float32), triangles)
    truth = truth / np.linalg.norm(truth, axis=-1, keepdims=True)
    sine = np.linalg.norm(np.cross(normals, truth), axis=-1)
    off = np.degrees(np.arctan2(sine, (normals * truth).sum(axis=-1)))
    return off[np.broadcast_to(counted, off.shape)]


@pytest.mark.parametrize("shape", SHAPES)
def test_normals_are_those_of_the_shape_to_a_degree(shape):
    assert degrees_off(*SHAPES[shape]()).max() < 1.0


@pytest.mark.parametrize("shape", SHAPES)
def test_normals_survive_points_that_coincide_but_for_single_precision(shape):
    points, triangles, truth, counted = SHAPES[shape]()
    noise = np.random.default_rng(5).uniform(-1e-7, 1e-7, points.shape)
    assert degrees_off(points + noise, triangles, truth, counted).max() < 1.0


def test_normals_of_a_mesh_far_from_the_origin_are_those_at_the_origin():
    points, triangles, truth, counted = torus()
    assert (
        degrees_off(points + np.array([300.0, -20.0, 7.0]), triangles, truth, counted).max() < 1.0
    )


@pytest.mark.parametrize(("fold", "smooth"), [(30, True), (75, True), (85, False), (120, False)])
def test_a_fold_is_smooth_below_eighty_degrees(fold, smooth):
    angle = np.radians(fold)
    points = [(-1, 0, 0), (0, 0, 0), (0, 0, 1), (-1, 0, 1)]
    points += [(np.cos(angle), np.sin(angle), z) for z in (0, 1)]
    triangles = np.array([(0, 3, 2), (0, 2, 1), (1, 2, 5), (1, 5, 4)])
    normals = smooth_normals(np.array(points, np.float32), triangles)
    on_edge = [normals[1, 2], normals[2, 0]]
    assert np.allclose(*on_edge, atol=1e-6) == smooth


def test_faces_that_meet_in_a_point_alone_keep_their_own_normals():
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1)], np.float32)
    normals = smooth_normals(points, np.array([(0, 1, 2), (0, 3, 4)]))
    assert np.allclose(normals[0], [0, 0, 1])
    assert np.allclose(normals[1], [-1, 0, 0])


def test_group_numbers_tell_all_combinations_apart_whatever_the_range():
    columns = np.random.default_rng(1).integers(-4, 4, (3, 4000))
    wide = columns * np.array([[2**60], [1], [2**40]])
    expected = np.unique(columns, axis=1, return_inverse=True)[1]
    for given in (columns, wide):
        numbers = group_numbers(*given)
        assert len(np.unique(numbers)) == expected.max() + 1
        assert len(np.unique(np.stack([numbers, expected.ravel()]), axis=1).T) == expected.max() + 1

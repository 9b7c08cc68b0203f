"""How finely `auto` refines, against the limit that it must come near to on the picture."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from pxr import UsdGeom
from scipy.spatial import cKDTree

from tests.reference.stages import new_stage, read
from tests.scene.surface.cages import CAGES, CUBE, SIDES, cage
from tests.scene.surface.catmull_clark import limit_of


def look(stage, distance):
    camera = UsdGeom.Camera.Define(stage, "/cam")
    UsdGeom.XformCommonAPI(camera).SetTranslate((0, 0, distance))
    camera.CreateFocalLengthAttr(50.0)
    camera.CreateHorizontalApertureAttr(25.0)
    stage.SetMetadata("metersPerUnit", 1.0)


@cache
def limit_points(name):
    points, faces, rules, *_ = CAGES[name]
    found, normals = limit_of(points, faces, 4, 2, **rules)
    known = np.isfinite(normals).all(axis=1)
    return found[known], normals[known]


def off_limit(mesh, name):
    """How far the middles of triangles and of their edges are from the surface [m]."""
    limit, normals = limit_points(name)
    corners = mesh.points[mesh.triangles]
    middles = np.concatenate([corners.mean(axis=1), 0.5 * (corners[:, 0] + corners[:, 1])])
    which = cKDTree(limit).query(middles)[1]
    return np.abs(((middles - limit[which]) * normals[which]).sum(axis=1)).max()


@pytest.mark.parametrize("name", ["a cube", "a sheet", "a heptagonal prism"])
@pytest.mark.parametrize("distance", [10, 100, 1000, 10000])
def test_auto_is_less_than_a_pixel_off_and_no_finer_than_that_needs(tmp_path, name, distance):
    points, faces, rules, *_ = CAGES[name]
    stage = new_stage(tmp_path)
    cage(stage, points, faces, **rules)
    look(stage, distance)
    scene = read(stage, complexity="auto", width=500)
    assert not scene.notes
    pixel = 1e-3 * distance
    assert off_limit(scene.meshes[0], name) < 0.8 * pixel
    cages = len(read(stage, complexity="low").meshes[0].triangles)
    if len(scene.meshes[0].triangles) > 4 * cages:
        coarser = read(stage, complexity="auto", width=62).meshes[0]
        assert off_limit(coarser, name) > 0.1 * pixel


def test_auto_sees_what_is_near_and_fills_a_picture_that_has_no_camera(tmp_path):
    stage = new_stage(tmp_path)
    cage(stage, CUBE, SIDES)

    def times():
        [mesh] = read(stage, complexity="auto", width=500).meshes
        return math.log(len(mesh.triangles) / 12, 4)

    filling = times()
    look(stage, 2.0)
    assert times() == filling + 1
    look(stage, 1000.0)
    assert times() == 1
    UsdGeom.Camera.Get(stage, "/cam").CreateProjectionAttr("orthographic")
    assert times() == filling


def test_auto_lives_with_points_that_are_not_finite(tmp_path):
    stage = new_stage(tmp_path)
    cage(stage, [(math.nan, 0, 0), *CUBE[1:]], SIDES)
    look(stage, 100)
    [mesh] = read(stage, complexity="auto", width=500).meshes
    assert len(mesh.triangles) >= 6 * 4


def test_a_small_coarse_part_of_a_flat_mesh_is_refined_too(tmp_path):
    """Fewer than one edge in twenty is a cube's; alone it would be refined as finely or finer."""
    count = 24
    line = np.linspace(-1, 1, count)
    flat = [(x, 0.0, z) for x in line for z in line]
    quads = [(count * i + j, count * i + 1 + j, count * i + count + 1 + j, count * i + count + j)
             for i in range(count - 1) for j in range(count - 1)]  # fmt: skip
    knob = [tuple(len(flat) + p for p in side) for side in SIDES]
    assert len(knob) < 0.05 * len(quads)
    stage = new_stage(tmp_path)
    cage(stage, flat, quads, path="/flat")
    cage(stage, [*flat, *CUBE], [*quads, *knob], path="/both")
    look(stage, 100.0)
    plain, both = read(stage, complexity="auto", width=500).meshes
    assert len(plain.triangles) == 2 * len(quads)
    assert len(both.triangles) >= 2 * 4 * (len(quads) + len(knob))

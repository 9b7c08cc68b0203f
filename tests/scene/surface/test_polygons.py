"""Polygons keep their area when they are cut into triangles."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fabricusd.scene.surface.polygons import triangulate


def _signed(corners):
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _outline_area(outline):
    x, y = outline.T
    return 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def _round(n, radii):
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.asarray(radii)[:, None]


def _comb(teeth):
    top = [(k, 1.0 if k % 2 else 9.0) for k in range(2 * teeth)]
    return np.array([*top[::-1], (-1, 0), (2 * teeth, 0)], float)


OUTLINES = {
    "an L": [(0, 0), (0.2, 0), (0.2, 0.1), (0.1, 0.1), (0.1, 0.3), (0, 0.3)],
    "an arrowhead": [(0, 0), (2, 1), (0, 2), (0.5, 1)],
    "an arrowhead from its notch": [(0.5, 1), (0, 0), (2, 1), (0, 2)],
    "a square with corners on its sides": [
        (0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1),
    ],
    "a square with a hole cut open to its side": [
        (0, 0), (4, 0), (4, 4), (0, 4), (0, 2), (1, 2), (1, 3), (3, 3), (3, 1), (1, 1), (1, 2),
        (0, 2),
    ],
    "a regular polygon": _round(9, np.ones(9)),
    "a comb": _comb(12),
    "a star of 60 points": _round(120, np.where(np.arange(120) % 2, 1.0, 0.2)),
}  # fmt: skip


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
@pytest.mark.parametrize("name", OUTLINES)
def test_no_triangle_lies_outside_or_twice_over(name, turn):
    outline = np.roll(np.array(OUTLINES[name], float), turn, axis=0)
    points = np.column_stack([outline, 0.3 * outline[:, 0] - 0.2 * outline[:, 1]])
    face, corners = triangulate(points, np.array([len(points)]), np.arange(len(points)))
    signed = _signed(outline[corners])
    assert len(corners) == len(outline) - 2
    assert (face == 0).all()
    assert np.abs(signed).sum() == pytest.approx(abs(_outline_area(outline)))
    assert (signed * np.sign(_outline_area(outline)) >= -1e-12).all()


@given(st.lists(st.floats(0.05, 1), min_size=5, max_size=40), st.integers(0, 39))
def test_any_outline_around_a_point_keeps_its_area(radii, turn):
    outline = np.roll(_round(len(radii), radii), turn, axis=0)
    points = np.column_stack([outline, np.zeros(len(outline))])
    _, corners = triangulate(points, np.array([len(points)]), np.arange(len(points)))
    signed = _signed(outline[corners])
    assert np.abs(signed).sum() == pytest.approx(_outline_area(outline), rel=1e-9)


def test_polygons_of_many_sizes_come_in_the_order_of_the_file():
    outlines = [np.array(OUTLINES[n], float) for n in ("an L", "an arrowhead", "a regular polygon")]
    counts = np.array([len(o) for o in outlines])
    flat = np.concatenate(outlines)
    points = np.column_stack([flat, np.zeros(len(flat))])
    face, corners = triangulate(points, counts, np.arange(len(flat)))
    assert face.tolist() == [0] * 4 + [1] * 2 + [2] * 7
    areas = np.bincount(face, np.abs(_signed(flat[corners])))
    assert areas == pytest.approx([abs(_outline_area(o)) for o in outlines])


def test_a_polygon_that_crosses_itself_ends_all_the_same():
    points = np.column_stack([np.random.default_rng(3).random((2000, 2)), np.zeros(2000)])
    begun = time.process_time()
    _, corners = triangulate(points, np.array([2000]), np.arange(2000))
    assert len(corners) == 1998
    # Looking for an ear again after each that was forced takes minutes.
    assert time.process_time() - begun < 20

"""Cages of subdivision surfaces, small and awkward."""

from __future__ import annotations

import math

from pxr import Gf, UsdGeom

from tests.scene.surface.catmull_clark import FOREVER

CUBE = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
EDGES = sorted({(min(e), max(e)) for f in SIDES for e in zip(f, f[1:] + f[:1], strict=True)})
TOP = [e for e in EDGES if CUBE[e[0]][1] > 0 and CUBE[e[1]][1] > 0]
SHEET = [(i, j, 0.4 * math.sin(i) + 0.3 * math.cos(2 * j)) for i in range(4) for j in range(4)]
QUADS = [(4 * i + j, 4 * i + 4 + j, 4 * i + 5 + j, 4 * i + 1 + j)
         for i in range(3) for j in range(3)]  # fmt: skip
THIRDS = [t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))]
ROUND = [k * 2 * math.pi / 7 for k in range(7)]
PRISM = [(math.cos(a), math.sin(a), z) for z in (-1, 1) for a in ROUND]
HEPTAGONS = [tuple(range(6, -1, -1)), tuple(range(7, 14))]
HEPTAGONS += [(k, (k + 1) % 7, 7 + (k + 1) % 7, 7 + k) for k in range(7)]
ROOFED = [*SIDES[:3], (2, 3, 8), (3, 7, 8), (7, 6, 8), (6, 2, 8), *SIDES[4:]]


def every(edges, sharpness):
    return dict.fromkeys(edges, sharpness)


CAGES = {
    # name: (points, faces, rules, tolerance of points, of normals [degrees])
    "a cube": (CUBE, SIDES, {}, 1e-6, 0.1),
    "a sheet": (SHEET, QUADS, {}, 1e-6, 0.1),
    "triangles": (SHEET, THIRDS, {}, 1e-6, 0.2),
    "a heptagonal prism": (PRISM, HEPTAGONS, {}, 1e-6, 0.1),
    "triangles, quads and points of five": ([*CUBE, (0, 2, 0)], ROOFED, {}, 1e-6, 0.1),
    "all edges for ever sharp": (CUBE, SIDES, {"crease": every(EDGES, FOREVER)}, 1e-3, 0.1),
    "a rim for ever sharp": (CUBE, SIDES, {"crease": every(TOP, FOREVER)}, 1e-3, 0.1),
    # No stencil ends a crease at once: the four steps to compare with are that far from the limit.
    "a crease that ends": (CUBE, SIDES, {"crease": {(0, 1): FOREVER}}, 3e-3, 2.0),
    "all edges sharp for two steps": (CUBE, SIDES, {"crease": every(EDGES, 2.0)}, 1e-6, 0.1),
    "a rim sharp for a step and a half": (CUBE, SIDES, {"crease": every(TOP, 1.5)}, 1e-6, 1.0),
    "all edges barely sharp": (CUBE, SIDES, {"crease": every(EDGES, 0.6)}, 1e-6, 0.1),
    "a sharp point": (CUBE, SIDES, {"sharp": {0: FOREVER}}, 1e-6, 0.1),
    "a point sharp for a step and a half": (CUBE, SIDES, {"sharp": {0: 1.5}}, 1e-6, 0.1),
    "a crease up to the border": (
        SHEET, QUADS, {"crease": every([(1, 5), (5, 9), (9, 13)], FOREVER)}, 1e-3, 0.1
    ),
    # Embree blends the last half step of a crease at a border with the rule of an inner point.
    "a fading crease up to the border": (
        SHEET, QUADS, {"crease": every([(1, 5), (5, 9), (9, 13)], 1.5)}, 1e-2, 2.0
    ),
    # Embree's B-spline of a rounded corner is off by this share of an edge, beside the corner.
    "rounded corners": (SHEET, QUADS, {"corners": False}, 1e-2, 0.2),
}  # fmt: skip


def cage(stage, points, faces, crease=None, sharp=None, corners=True, path="/mesh"):
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([Gf.Vec3f(*p) for p in points])
    mesh.CreateFaceVertexCountsAttr([len(f) for f in faces])
    mesh.CreateFaceVertexIndicesAttr([p for f in faces for p in f])
    if crease:
        mesh.CreateCreaseIndicesAttr([p for e in crease for p in e])
        mesh.CreateCreaseLengthsAttr([2] * len(crease))
        mesh.CreateCreaseSharpnessesAttr(list(crease.values()))
    if sharp:
        mesh.CreateCornerIndicesAttr(list(sharp))
        mesh.CreateCornerSharpnessesAttr(list(sharp.values()))
    mesh.CreateInterpolateBoundaryAttr("edgeAndCorner" if corners else "edgeOnly")
    return mesh

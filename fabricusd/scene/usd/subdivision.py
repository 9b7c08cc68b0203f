"""Reads the subdivision surface of a UsdGeomMesh; faults are noted and left out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from fabricusd.scene.scene import Scene
from fabricusd.scene.surface.embree_subdivision import INFINITE, MOST_CORNERS, available
from fabricusd.scene.surface.face_varying import RULES
from fabricusd.scene.surface.polygons import triangulate
from fabricusd.scene.surface.subdivision import Cage, Topology, too_crowded
from fabricusd.scene.surface.tessellation import Refinement
from fabricusd.scene.usd.value import array_of, value_of

_BOUNDARIES = ("none", "edgeOnly", "edgeAndCorner")


def read_refinement(
    mesh: UsdGeom.Mesh,
    time: Usd.TimeCode,
    points: NDArray[np.float64],
    counts: NDArray[np.int64],
    indices: NDArray[np.int64],
    hidden: NDArray[np.bool_],
    scene: Scene,
    level: int,
) -> Refinement | None:
    """The mesh's surface; None, with a note, where only its cage can be rendered.

    points, counts, indices : of the mesh, already checked; hidden : (f,) bool - its holes
    level : 0 for the cage
    """
    where = str(mesh.GetPath())
    scheme = str(value_of(mesh.GetSubdivisionSchemeAttr(), time, scene))
    surface = f"is a subdivision surface ({scheme}), rendered at its cage"
    if scheme != "catmullClark" or not level:
        scene.note(where, surface)
        return None
    if not available():
        scene.note(where, f"{surface}: Embree's own library is not here")
        return None
    cut_counts, cut_indices, face, corner = _simple(points, counts, indices, where, scene)
    if not len(cut_counts):
        scene.note(where, f"{surface}: no face can be refined")
        return None
    topology = Topology(cut_counts, cut_indices, len(points))
    crowded = too_crowded(topology)
    if crowded:
        scene.note(where, f"{surface}: it {crowded}")
        return None
    rule = value_of(mesh.GetTriangleSubdivisionRuleAttr(), time, scene)
    smooth = rule == UsdGeom.Tokens.smooth
    if smooth and (cut_counts == 3).any():
        scene.note(where, "has triangleSubdivisionRule 'smooth', refined by 'catmullClark'")
    boundary = _token(mesh.GetInterpolateBoundaryAttr(), time, _BOUNDARIES, where, scene)
    finite = np.where(np.isfinite(points), points, 0.0)
    crease = _creases(mesh, time, topology, where, scene)
    unseen = hidden[face]
    if boundary == "none":
        unseen = unseen | _beside_the_border(topology, crease)
    cage = Cage(
        points=finite,
        topology=topology,
        crease=crease,
        sharpness=_corners(mesh, time, len(points), where, scene),
        sharp_corners=boundary == "edgeAndCorner",
        hidden=unseen,
    )
    rule = _token(mesh.GetFaceVaryingLinearInterpolationAttr(), time, RULES, where, scene)
    return Refinement(cage=cage, face=face, corner=corner, rule=rule)


def _token(
    attribute: Usd.Attribute, time: Usd.TimeCode, known: tuple[str, ...], where: str, scene: Scene
) -> str:
    """A token's value; its fallback, with a note, where the value is not one of `known`."""
    value = str(value_of(attribute, time, scene))
    if value in known:
        return value
    fallback = "edgeAndCorner" if "edgeAndCorner" in known else "cornersPlus1"
    scene.note(
        where,
        f"{attribute.GetName()} is '{value}'; it must be one of {', '.join(known)}; "
        f"taken as '{fallback}'",
    )
    return fallback


def _simple(
    points: NDArray[np.float64],
    counts: NDArray[np.int64],
    indices: NDArray[np.int64],
    where: str,
    scene: Scene,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """(counts, indices, face, corner) of the faces that can be refined; the last two are indices of
    the mesh's own faces and corners.

    A corner that repeats the one before is left out. So is a face with fewer than three corners, or
    with a point that is not finite. A face with more than MOST_CORNERS corners becomes triangles.
    """
    own = Topology(counts, indices, len(points))
    corner = np.flatnonzero(indices != indices[own.after])
    bad = ~np.asarray(np.isfinite(points).all(axis=1))[indices]
    lost = np.zeros(len(counts), bool)
    lost[own.face[bad]] = True
    if lost.any():
        number = len(np.unique(indices[bad]))
        scene.note(
            where,
            f"has {number} points that are not finite; {int(lost.sum())} faces are left out",
        )
    size = np.bincount(own.face[corner], minlength=len(counts))
    kept = np.asarray((size >= 3) & ~lost)
    corner = corner[kept[own.face[corner]]]
    face = np.flatnonzero(kept)
    large = np.flatnonzero(size[face] > MOST_CORNERS)
    if not len(large):
        return size[face], indices[corner], face, corner
    first = int(face[large[0]])
    scene.note(
        where,
        f"has a face of {size[first]} corners (face {first}); what has more than {MOST_CORNERS} is "
        "cut into triangles before it is refined",
    )
    of = np.repeat(np.arange(len(face)), size[face])
    big = corner[np.isin(of, large)]
    which, cut = triangulate(points, size[face[large]], indices[big])
    small = ~np.isin(np.arange(len(face)), large)
    face_all = np.concatenate([face[small], face[large[which]]])
    counts_all = np.concatenate([size[face[small]], np.full(len(which), 3)])
    corner_all = np.concatenate([corner[small[of]], big[cut].ravel()])
    return counts_all, indices[corner_all], face_all, corner_all


def _creases(
    mesh: UsdGeom.Mesh, time: Usd.TimeCode, topology: Topology, where: str, scene: Scene
) -> NDArray[np.float64]:
    """(e,) sharpness of the topology's edges; for an edge that is named twice, the last one."""
    crease = np.zeros(len(topology.uses))
    points = array_of(mesh.GetCreaseIndicesAttr(), time, scene, np.int64)
    lengths = array_of(mesh.GetCreaseLengthsAttr(), time, scene, np.int64)
    sharpness = array_of(mesh.GetCreaseSharpnessesAttr(), time, scene)
    if not len(points) and not len(lengths):
        return crease
    edges = int((lengths - 1).sum())
    problem = ""
    if len(lengths) and lengths.min() < 2:
        problem = f"creaseLengths has {lengths.min()}; each must be at least 2"
    elif lengths.sum() != len(points):
        problem = f"creaseLengths add up to {lengths.sum()}; they must to the {len(points)} indices"
    elif len(sharpness) not in (len(lengths), edges):
        problem = (
            f"creaseSharpnesses has {len(sharpness)} values; it must have {len(lengths)}, one a "
            f"crease, or {edges}, one an edge"
        )
    if problem:
        scene.note(where, f"{problem}; it is refined without creases")
        return crease
    chain = np.repeat(np.arange(len(lengths)), lengths)
    inside = np.flatnonzero(chain[1:] == chain[:-1])
    pairs = np.stack([points[inside], points[inside + 1]], axis=1)
    if len(sharpness) != edges:
        sharpness = sharpness[chain[inside]]
    sharpness = _sound(sharpness, "creaseSharpnesses", where, scene)
    found = np.full(len(pairs), -1)
    known = ((pairs >= 0) & (pairs < topology.count)).all(axis=1)
    found[known] = topology.edges_of(pairs[known])
    if (found < 0).any():
        a, b = pairs[np.argmax(found < 0)]
        scene.note(
            where, f"creaseIndices has the edge {a} to {b}; it must be one of a face; left smooth"
        )
    crease[found[found >= 0]] = sharpness[found >= 0]
    return crease


def _corners(
    mesh: UsdGeom.Mesh, time: Usd.TimeCode, count: int, where: str, scene: Scene
) -> NDArray[np.float64]:
    """(n,) sharpness of the points."""
    found = np.zeros(count)
    points = array_of(mesh.GetCornerIndicesAttr(), time, scene, np.int64)
    sharpness = array_of(mesh.GetCornerSharpnessesAttr(), time, scene)
    if len(points) != len(sharpness):
        scene.note(
            where,
            f"cornerSharpnesses has {len(sharpness)} values; it must have {len(points)}, one a "
            "corner; it is refined without corners",
        )
        return found
    known = (points >= 0) & (points < count)
    if not known.all():
        bad = points[np.argmin(known)]
        scene.note(where, f"cornerIndices has {bad}; it must be from 0 to {count - 1}; left smooth")
    sharpness = _sound(sharpness, "cornerSharpnesses", where, scene)
    found[points[known]] = sharpness[known]
    return found


def _sound(
    sharpness: NDArray[np.float64], name: str, where: str, scene: Scene
) -> NDArray[np.float64]:
    """`sharpness` with 0, and a note, for values that are negative or NaN."""
    wrong = ~(sharpness >= 0)
    if wrong.any():
        bad = sharpness[np.argmax(wrong)]
        scene.note(where, f"{name} has {bad:g}; each must be at least 0; taken as 0")
    return np.where(wrong, 0.0, sharpness)


def _beside_the_border(topology: Topology, crease: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(f,) bool - the faces that OpenSubdiv hides where the border is not interpolated: those that
    touch a point of the border, unless that border is infinitely sharp."""
    loose = np.zeros(topology.count, bool)
    loose[topology.ends[(topology.uses == 1) & (crease < INFINITE)].ravel()] = True
    return np.bincount(topology.face, loose[topology.indices], len(topology.counts)) > 0

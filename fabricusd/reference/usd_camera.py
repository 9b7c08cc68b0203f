"""UsdGeomCamera prims as cameras."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom

from fabricusd.reference.scene import Camera, Scene


def read_camera(prim: Usd.Prim, time: Usd.TimeCode, metres: float, scene: Scene) -> Camera | None:
    """The camera of a prim, or None with a note where it sees nothing.

    metres : in one scene unit; a camera's lengths on film are in tenths of a scene unit
    """
    camera = UsdGeom.Camera(prim)
    where = str(prim.GetPath())

    def value(attribute: Any) -> float:
        return float(attribute.Get(time))

    film = 0.1 * metres
    orthographic = camera.GetProjectionAttr().Get(time) == UsdGeom.Tokens.orthographic
    lengths = {
        "horizontalAperture": value(camera.GetHorizontalApertureAttr()),
        "focalLength": 1.0 if orthographic else value(camera.GetFocalLengthAttr()),
    }
    offset = (
        value(camera.GetHorizontalApertureOffsetAttr()) * film,
        value(camera.GetVerticalApertureOffsetAttr()) * film,
    )
    near, far = camera.GetClippingRangeAttr().Get(time)
    matrix = UsdGeom.XformCache(time).GetLocalToWorldTransform(prim)
    problem = _problem(lengths, offset, (near, far), matrix)
    if problem:
        scene.note(where, f"{problem}, left out")
        return None
    if camera.GetClippingPlanesAttr().Get(time):
        scene.note(where, "has clipping planes, left out; its clipping range is kept")
    focus, f_stop = value(camera.GetFocusDistanceAttr()), value(camera.GetFStopAttr())
    if f_stop > 0 and not focus > 0 and not orthographic:
        scene.note(where, f"has f-stop {f_stop:g} and no focus distance; all is rendered sharp")
    return Camera(
        path=where,
        frame=_frame(matrix, metres),
        focal_length=lengths["focalLength"] * film,
        aperture=(
            lengths["horizontalAperture"] * film, value(camera.GetVerticalApertureAttr()) * film,
        ),
        aperture_offset=offset,
        f_stop=f_stop if math.isfinite(f_stop) else 0.0,
        focus_distance=focus * metres if math.isfinite(focus) else 0.0,
        orthographic=orthographic,
        clipping=(near * metres, far * metres),
        exposure=_stops(camera, time),
    )  # fmt: skip


def _problem(
    lengths: dict[str, float],
    offset: tuple[float, float],
    clipping: tuple[float, float],
    matrix: Gf.Matrix4d,
) -> str:
    """Why nothing can be seen through such a camera, or an empty string."""
    for name, length in lengths.items():
        if not (math.isfinite(length) and length > 0):
            return f"has {name} {length:g}, which must be above 0"
    if not np.isfinite(offset).all():
        return "has an aperture offset that is not finite"
    if not clipping[0] < clipping[1]:
        return f"has clippingRange {clipping[0]:g} to {clipping[1]:g}, which must rise"
    if not np.isfinite(np.array(matrix)).all():
        return "has a transform that is not finite"
    return ""


def _frame(matrix: Gf.Matrix4d, metres: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(4, 4) orthonormal axes and position [m]; as in other viewers scale and shear are left out,
    and a mirrored camera does not mirror what it sees."""
    frustum = Gf.Frustum()
    frustum.SetPositionAndRotationFromMatrix(matrix)
    frame = np.array(frustum.ComputeViewInverse(), np.float64).T
    frame[:3, 3] *= metres
    return frame


def _stops(camera: UsdGeom.Camera, time: Usd.TimeCode) -> float:
    """Exposure in stops, of compensation, ISO, time, f-stop and responsivity together."""
    scale = float(camera.ComputeLinearExposureScale(time))
    return math.log2(scale) if math.isfinite(scale) and scale > 0 else 0.0

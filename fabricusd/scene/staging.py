"""Staging: the light, the background and the camera of a review, put around a scene that was read.

It stands in for what a user would otherwise author in USD: a dome with a picture, a studio, a
camera that frames a prim or goes around it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError, did_you_mean
from fabricusd.images.files import read_image
from fabricusd.scene.light_kinds import DOME
from fabricusd.scene.scene import (
    Camera,
    FabricSurface,
    Light,
    Material,
    Mesh,
    PreviewSurface,
    Scene,
)
from fabricusd.scene.studio import (
    GREY,
    ROUGHNESS,
    Subject,
    backdrop,
    framing,
    looking,
    studio_camera,
    studio_lights,
)

Vector = NDArray[np.float64]
Place = tuple[float, float, float]

MOST_TEXELS = 4096
"""Longest side of a dome's picture; a larger one is shrunk."""


@dataclass(frozen=True, kw_only=True)
class Staging:
    """What to put around a scene; the default puts nothing.

    dome : file of a latitude-longitude picture, which replaces the scene's domes
    dome_rotation : of all domes about the up axis, counter-clockwise from above [rad]
    background : linear colour that the camera sees instead of the domes; None leaves them
    studio : replace the lights by a studio's, and add its backdrop
    frame : prim path or name of what the camera frames, "" for none; "/" for the whole scene
    eye, look_at : places of the camera, and of what it looks at [m]; None leaves them
    orbit : number of pictures around the subject, 0 for one picture
    surface_law : law that all fabrics wear, one of `fabric.SURFACE_LAWS`; "" for their own
    """

    dome: str | os.PathLike[str] | None = None
    dome_rotation: float = 0.0
    background: Place | None = None
    studio: bool = False
    frame: str = ""
    eye: Place | None = None
    look_at: Place | None = None
    orbit: int = 0
    surface_law: str = ""

    @property
    def moves_the_camera(self) -> bool:
        """Whether the camera is another than the scene's."""
        return bool(self.frame or self.orbit or self.eye or self.look_at)


def put(staging: Staging, scene: Scene, aspect: float, *, turn: float = 0.0) -> None:
    """Change `scene` as `staging` says.

    aspect : width over height of the picture
    turn : by which the camera goes around the subject, counter-clockwise from above [rad]

    Raises FabricError for a dome that cannot be read, for a frame that names no mesh, and for a law
    that a fabric cannot wear.
    """
    if staging.surface_law:
        scene.materials = [_wearing(m, staging.surface_law) for m in scene.materials]
    subject = _subject(scene, framed_meshes(scene, staging.frame))
    if staging.studio:
        everything = _subject(scene, scene.meshes)
        scene.lights = studio_lights(everything)
        _add_backdrop(scene, everything)
    if staging.dome is not None:
        scene.lights = [light for light in scene.lights if light.kind != DOME]
        scene.lights.append(_dome(staging.dome, scene.up_axis))
    if staging.dome_rotation:
        turned = _about(subject.axes[:, 1], staging.dome_rotation)
        scene.lights = [
            replace(light, frame=turned @ light.frame) if light.kind == DOME else light
            for light in scene.lights
        ]
    if staging.background is not None:
        scene.lights = [replace(light, hidden=True, camera_visible=False) for light in scene.lights]
    if staging.moves_the_camera or (staging.studio and scene.camera is None):
        scene.camera = _camera(staging, scene, subject, aspect, turn)


def _wearing(material: Material, law: str) -> Material:
    """The material with its fabric, and the back of that, under another surface law."""
    if not isinstance(material, FabricSurface):
        return material
    fabric = material.binding.fabric
    back = None if fabric.back is None else replace(fabric.back, surface_law=law)
    worn = replace(fabric, surface_law=law, back=back)
    return replace(material, binding=replace(material.binding, fabric=worn))


def framed_meshes(scene: Scene, frame: str) -> Sequence[Mesh]:
    """The meshes of the prim `frame`, by its path or by a name that no other prim has."""
    if frame in ("", "/"):
        return scene.meshes
    inside = _meshes_at(scene, frame)
    if inside:
        return inside
    # By name: the prim may be a mesh, or anything above one.
    found: dict[str, str] = {}
    names: set[str] = set()
    for path in (path for mesh in scene.meshes for path in mesh.paths):
        parts = path.replace(":", "/").split("/")
        names.update(part for part in parts if part)
        for k, part in enumerate(parts):
            if part == frame:
                place = "/".join(parts[: k + 1])
                found[place] = path[: len(place)]
    if len(found) > 1:
        several = ", ".join(list(found)[:8])
        raise FabricError(f"--frame '{frame}'", f"is the name of several prims: {several}")
    if not found:
        raise FabricError(
            f"--frame '{frame}'",
            f"is no mesh of the scene, or prim above one{did_you_mean(frame, names)}; meshes are: "
            + (", ".join(mesh.path for mesh in scene.meshes[:8]) or "none"),
        )
    return _meshes_at(scene, next(iter(found.values())))


def _meshes_at(scene: Scene, place: str) -> list[Mesh]:
    """The meshes whose path is `place` or lies below it, instances without those elsewhere."""

    def is_inside(path: str) -> bool:
        return path == place or path.startswith((f"{place}/", f"{place}:"))

    found = []
    for mesh in scene.meshes:
        placements = mesh.placements
        if placements is None:
            if is_inside(mesh.path):
                found.append(mesh)
        elif (inside := placements.where(is_inside)) is not None:
            found.append(replace(mesh, placements=inside))
    return found


def over_background(beauty: NDArray[np.float32], background: Place) -> NDArray[np.float32]:
    """(h, w, 4) RGBA over a colour; the result is opaque."""
    result = beauty.copy()
    result[..., :3] += (1.0 - beauty[..., 3:4]) * np.asarray(background, np.float32)
    result[..., 3] = 1.0
    return result


def _subject(scene: Scene, meshes: Sequence[Mesh]) -> Subject:
    low, high = Scene(meshes=list(meshes)).bounds()
    return Subject(low=low, high=high, up_axis=scene.up_axis)


def _add_backdrop(scene: Scene, subject: Subject) -> None:
    points, quads = backdrop(subject)
    triangles = np.concatenate((quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]))
    scene.materials.append(PreviewSurface(name="backdrop", diffuse=GREY, roughness=ROUGHNESS))
    scene.meshes.append(
        Mesh(
            path="studio backdrop",
            points=points,
            triangles=triangles,
            material=np.full(len(triangles), len(scene.materials) - 1, np.int32),
        )
    )


def _dome(path: str | os.PathLike[str], up_axis: str) -> Light:
    """A dome with the picture of a file, upright in the scene."""
    picture = read_image(path, most=MOST_TEXELS)
    if not np.isfinite(picture).all() or (picture < 0).any():
        raise FabricError(
            str(path), "has values that are negative or not finite; it must have none"
        )
    image = np.ascontiguousarray(np.broadcast_to(picture, (*picture.shape[:2], 3)), np.float32)
    frame = np.eye(4)
    if up_axis == "Z":
        frame[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    return Light(
        path=str(path), kind=DOME, radiance=(1.0, 1.0, 1.0), frame=frame, image=image,
        camera_visible=True,
    )  # fmt: skip


def _camera(staging: Staging, scene: Scene, subject: Subject, aspect: float, turn: float) -> Camera:
    """The camera that frames the subject, stands at `eye`, or looks at `look_at`."""
    now = scene.camera
    if staging.frame or now is None:
        # As the scene's camera looks, where there is one.
        towards = studio_camera(subject).frame[:3, 2] if now is None else now.frame[:3, 2]
        camera = framing(subject, towards, aspect)
    else:
        camera = now
    at = np.array(staging.look_at) if staging.look_at else subject.centre
    eye = np.array(staging.eye) if staging.eye else camera.frame[:3, 3]
    frame = camera.frame
    if staging.eye or staging.look_at:
        if np.linalg.norm(eye - at) < 1e-9:
            raise FabricError("--eye", f"is where the camera looks, {eye}; it must be elsewhere")
        frame = looking(eye, at, subject.axes[:, 1])
    if turn:
        round_ = _about(subject.axes[:, 1], turn)
        round_[:3, 3] = at - round_[:3, :3] @ at
        frame = round_ @ frame
    distance = float(np.linalg.norm(frame[:3, 3] - at))
    return replace(
        camera, path=f"{camera.path or 'camera'}, placed", frame=frame, focus_distance=distance
    )


def _about(axis: Vector, angle: float) -> Vector:
    """(4, 4) rotation about an axis through the origin [rad]."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned = np.eye(4)
    turned[:3, :3] += math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
    return turned

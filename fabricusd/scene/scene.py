"""The description of a scene: triangles in metres, their materials, lights and a camera.

The classes hold plain values and do not depend on USD. `scene.usd` and `scene.files` create them;
the path tracer compiles them into the arrays that kernels read. World space is right-handed, and
lengths are metres.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.fabric import Binding
from fabricusd.scene.placements import Placements, bounds_of


@dataclass(frozen=True, kw_only=True, eq=False)
class Texture:
    """An image that is looked up by UV.

    pixels : (h, w, c) float32, linear, row 0 at the top; c is 1 or 3
    wrap : (2,) str - `repeat`, `clamp`, `mirror` or `black`, along u and v
    place : a, b, c, d, e, f - the picture is looked up at (a u + b v + c, d u + e v + f)
    """

    pixels: NDArray[np.float32]
    wrap: tuple[str, str] = ("repeat", "repeat")
    place: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class PreviewSurface:
    """A UsdPreviewSurface material: a Lambertian base under GGX, in the metallic workflow.

    diffuse, emissive : (3,) float - linear Rec. 709
    ior : index of refraction; 1 removes the specular layer
    transmission : linear Rec. 709 - share of the light that leaves on the other side, scattered
        evenly; the surface is then a thin sheet
    textures : for diffuse, emissive, metallic, roughness, opacity, normal and transmission. A
        texture replaces its constant instead of multiplying it. The texels of `normal` are normals
        of any length in tangent space, see `normal_map`; a texel of length 0 stands for the
        surface's own normal.
    """

    name: str = ""
    diffuse: tuple[float, float, float] = (0.18, 0.18, 0.18)
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    metallic: float = 0.0
    roughness: float = 0.5
    ior: float = 1.5
    opacity: float = 1.0
    opacity_threshold: float = 0.0
    transmission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    textures: dict[str, Texture] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class FabricSurface:
    """A woven fabric that is laid on a mesh by the mesh's UVs."""

    name: str = ""
    binding: Binding


Material = PreviewSurface | FabricSurface


@dataclass(frozen=True, kw_only=True, eq=False)
class Mesh:
    """The triangles of one prim in world space, counter-clockwise seen from the front.

    points : (n, 3) float64 [m]
    triangles : (m, 3) int
    normals : (m, 3, 3) float or None - at each corner; None to compute them
    smooth : bool - if `normals` is None: True for smooth normals over shared points, False for
        facets
    uv : (m, 3, 2) float64 or None - at each corner
    material : (m,) int - index into `Scene.materials`
    origin : str - identifies the mesh of which this may be a copy; only meshes of the same origin
        are baked as one
    placements : where the mesh appears, if it is instanced; None where it appears as it is
    """

    path: str
    points: NDArray[np.float64]
    triangles: NDArray[Any]
    normals: NDArray[Any] | None = None
    smooth: bool = True
    uv: NDArray[np.float64] | None = None
    material: NDArray[Any]
    origin: str = ""
    placements: Placements | None = None

    @property
    def paths(self) -> tuple[str, ...]:
        """The paths of the prims that are this mesh."""
        return (self.path,) if self.placements is None else self.placements.paths

    @property
    def times(self) -> int:
        """How often the mesh appears."""
        return 1 if self.placements is None else len(self.placements)


@dataclass(frozen=True, kw_only=True, eq=False)
class Light:
    """One light. Its radiance is constant over its surface and over the directions it emits to.

    radiance : (3,) float [W/m2/sr]; for a distant light without an angle, the irradiance [W/m2]
    frame : (4, 4) float64 - columns: x, y, z axes (their lengths scale the light) and position [m];
        rect, disk and distant lights shine along -z, a cylinder lies along x, a dome's pole is +y
    width, height : float [m] - of a rect; height is a cylinder's length
    radius : float [m] - of a disk, sphere or cylinder
    angle : float - diameter of a distant light [rad]
    image : (h, w, 3) float32 or None - a dome's latitude-longitude picture, which `radiance` scales
    camera_visible : bool - whether the camera sees the light; indirect rays always do
    hidden : bool - whether the camera does not see a dome, which it otherwise sees
    """

    path: str
    kind: int
    radiance: tuple[float, float, float]
    frame: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    width: float = 1.0
    height: float = 1.0
    radius: float = 0.5
    angle: float = 0.0
    image: NDArray[np.float32] | None = None
    camera_visible: bool = False
    hidden: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Camera:
    """A thin-lens camera that looks along its frame's -z, with +y up.

    frame : (4, 4) float64 - orthonormal columns x, y, z and position [m]
    focal_length, aperture (width, height), aperture_offset : float [m]; for an orthographic camera,
        the aperture is the extent of the visible region
    f_stop : float - 0 for a pinhole; focus_distance : float [m]
    clipping : (2,) float [m]
    exposure : float - in stops
    """

    path: str = ""
    frame: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    focal_length: float = 0.05
    aperture: tuple[float, float] = (0.036, 0.024)
    aperture_offset: tuple[float, float] = (0.0, 0.0)
    f_stop: float = 0.0
    focus_distance: float = 0.0
    orthographic: bool = False
    clipping: tuple[float, float] = (0.0, 1e30)
    exposure: float = 0.0


@dataclass(kw_only=True, eq=False)
class Scene:
    """Everything to render, with `notes` about what had to be left out or assumed.

    refined : number of triangles that subdivision surfaces were refined to
    """

    meshes: list[Mesh] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    camera: Camera | None = None
    notes: list[str] = field(default_factory=list)
    up_axis: str = "Y"
    refined: int = 0
    _told: set[str] = field(default_factory=set, repr=False)

    def note(self, where: str, problem: str) -> None:
        """Add one line about `where`, unless it has been added before."""
        line = f"{where} {problem}"
        # Look lines up in a set: a list is slow to search if each of many prims has its own line.
        if line not in self._told:
            self._told.add(line)
            self.notes.append(line)

    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The bounding box (low, high) [m] of all triangles with finite corners; zeros if there are
        none."""
        boxes = [box for box in map(_box, self.meshes) if box is not None]
        if not boxes:
            return np.zeros(3), np.zeros(3)
        return np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)

    @property
    def instances(self) -> int:
        """Number of places at which instanced meshes appear, several meshes at one place as one."""
        found = [m.placements.transforms for m in self.meshes if m.placements is not None]
        return sum(len(one) for one in {id(one): one for one in found}.values())


def _box(mesh: Mesh) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """The mesh's bounding box, at all of its places; None where it has no finite corner."""
    corners = _corners(mesh)
    if not len(corners):
        return None
    if mesh.placements is not None:
        return bounds_of(corners, mesh.placements.transforms)
    return corners.min(axis=0), corners.max(axis=0)


def _corners(mesh: Mesh) -> NDArray[np.float64]:
    """(n, 3) points of a mesh that belong to triangles whose corners are all finite."""
    finite = np.asarray(np.isfinite(mesh.points).all(axis=1))
    triangles = np.asarray(mesh.triangles)
    if not finite.all():
        triangles = triangles[finite[triangles].all(axis=1)]
    used = np.zeros(len(mesh.points), bool)
    used[triangles.ravel()] = True
    return np.asarray(mesh.points[used])

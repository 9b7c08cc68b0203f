"""Small scenes with known answers, and the comparison of pictures by their own variance."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from fabricusd.fabric import Binding, Fabric
from fabricusd.reference.render import RenderResult, render_scene
from fabricusd.scene.light_kinds import DISTANT
from fabricusd.scene.scene import Camera, FabricSurface, Light, Mesh, PreviewSurface, Scene


def looking(eye: Any, at: Any = (0.0, 0.0, 0.0), up: Any = (0.0, 1.0, 0.0)) -> NDArray[np.float64]:
    """(4, 4) frame at `eye` whose -z points to `at`."""
    back = np.subtract(eye, at).astype(float)
    back /= np.linalg.norm(back)
    right = np.cross(up, back)
    if np.linalg.norm(right) < 1e-9:
        right = np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    frame = np.eye(4)
    frame[:3, 0], frame[:3, 1], frame[:3, 2] = right, np.cross(back, right), back
    frame[:3, 3] = eye
    return frame


def above(height: float = 2.0, width: float = 0.2) -> Camera:
    """An orthographic camera that looks down on the origin and sees `width` metres."""
    return Camera(frame=looking((0.0, height, 0.0)), orthographic=True, aperture=(width, width))


def grid(height: Any = None, *, size: float = 1.0, cells: int = 1, material: int = 0) -> Mesh:
    """A square in the plane y = 0, or y = height(x, z), its front upwards, with UVs in metres."""
    line = np.linspace(-size / 2, size / 2, cells + 1)
    x, z = np.meshgrid(line, line)
    y = np.zeros_like(x) if height is None else height(x, z)
    points = np.stack([x, y, z], -1).reshape(-1, 3)
    i = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel(), i[1:, :-1].ravel()
    tri = np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)])
    uv = np.stack([x, -z], -1).reshape(-1, 2)[tri]
    return Mesh(
        path="grid", points=points, triangles=tri, uv=uv, material=np.full(len(tri), material)
    )


def sphere(cells: int = 64, radius: float = 1.0) -> Mesh:
    """A sphere with smooth normals and UVs."""
    theta = np.linspace(0, np.pi, cells + 1)
    phi = np.linspace(0, 2 * np.pi, 2 * cells + 1)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    points = radius * np.stack([np.sin(t) * np.sin(p), np.cos(t), np.sin(t) * np.cos(p)], -1)
    n = 2 * cells + 1
    i = np.arange(points.shape[0] * n).reshape(-1, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    tri = np.concatenate([np.stack([a, b, c], 1)[2 * cells * 0 :], np.stack([a, c, d], 1)])
    flat = points.reshape(-1, 3)
    area = np.linalg.norm(
        np.cross(flat[tri[:, 1]] - flat[tri[:, 0]], flat[tri[:, 2]] - flat[tri[:, 0]]), axis=1
    )
    tri = tri[area > 1e-9]
    uv = np.stack([p, -t], -1).reshape(-1, 2)[tri]
    return Mesh(
        path="sphere",
        points=flat,
        triangles=tri,
        normals=flat[tri] / radius,
        uv=uv,
        material=np.zeros(len(tri), int),
    )


def lambert(*albedo: float) -> PreviewSurface:
    """Purely diffuse: an index of refraction of 1 has no specular layer."""
    colors = albedo if len(albedo) == 3 else albedo * 3
    return PreviewSurface(diffuse=(colors[0], colors[1], colors[2]), ior=1.0, roughness=1.0)


def cloth(fabric: Fabric, threads: float = 40.0) -> FabricSurface:
    """A fabric with so many threads to a unit of UV."""
    return FabricSurface(binding=Binding(fabric=fabric, threads_per_uv=(threads, threads)))


def sun(towards: Any = (0.0, 1.0, 0.0), irradiance: Any = (1.0, 1.0, 1.0)) -> Light:
    """A distant light without angle."""
    frame = looking(towards)
    frame[:3, 3] = 0.0
    return Light(path="sun", kind=DISTANT, radiance=tuple(irradiance), frame=frame)


def picture(
    meshes: list[Mesh],
    materials: list[Any],
    lights: list[Light],
    camera: Camera,
    *,
    size: int = 16,
    **settings: Any,
) -> RenderResult:
    """A square picture of a scene made of these."""
    scene = Scene(meshes=meshes, materials=materials, lights=lights, camera=camera)
    settings.setdefault("aovs", ("beauty", "variance"))
    settings.setdefault("pixel_filter", "box")
    return render_scene(scene, width=size, height=size, **settings)


def blocks(image: NDArray[Any], count: int) -> NDArray[np.float64]:
    """(h, w, c) -> (count^2, c) means of square blocks."""
    h, w, c = image.shape
    cut = image.astype(float).reshape(count, h // count, count, w // count, c)
    return np.asarray(cut.mean(axis=(1, 3)).reshape(-1, c))


def worst_z(a: RenderResult, b: RenderResult, count: int = 4) -> float:
    """The largest |z| between two pictures' block means, by their own variances."""
    difference = blocks(a.layers["beauty"][..., :3], count) - blocks(
        b.layers["beauty"][..., :3], count
    )
    pixels = a.layers["beauty"].shape[0] * a.layers["beauty"].shape[1] / count**2
    variance = (blocks(a.layers["variance"], count) + blocks(b.layers["variance"], count)) / pixels
    return float(np.max(np.abs(difference) / np.sqrt(variance + 1e-14)))


def z_limit(tests: int, error_rate: float = 1e-4) -> float:
    """The |z| that `tests` comparisons together exceed with this probability."""
    return float(stats.norm.isf(error_rate / (2 * tests)))

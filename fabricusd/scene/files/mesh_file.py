"""Turns OBJ, glTF and PLY files into scenes in metres, with one fabric for all meshes with UVs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError, one_line
from fabricusd.fabric import Binding
from fabricusd.scene.files.gltf import read_gltf
from fabricusd.scene.files.obj import read_obj
from fabricusd.scene.files.piece import MeshFile, Piece, unique_names
from fabricusd.scene.files.ply import read_ply
from fabricusd.scene.scene import FabricSurface, Material, Mesh, PreviewSurface, Scene
from fabricusd.scene.size import note_size, unit_length
from fabricusd.scene.surface.normals import smooth_normals

WITH_INSTANCES = (".glb", ".gltf")
"""Suffixes of formats in which one mesh may be placed several times."""

READERS: dict[str, Callable[[Path], MeshFile]] = {
    ".obj": read_obj,
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".ply": read_ply,
}

FARTHEST = 1e9
"""Largest coordinate [m]: beyond it, squared areas overflow float32."""

GREY, CLOTH = 0, 1


def read_mesh_file(path: Path, binding: Binding | None, units: str | None = None) -> Scene:
    """Read the file's meshes with +y up, each named after the file and its piece.

    Triangles with UVs get the fabric of `binding`; without a binding, all triangles are grey.

    units : the file's unit of length, one of `size.UNITS`; None for metres

    Raises `FabricError` if the file cannot be read or holds no triangles.
    """
    metres = unit_length(units, path.suffix.lower())
    file = _read(path)
    scene = Scene()
    cloth: Material = PreviewSurface(name="grey")
    scene.materials.append(cloth)
    if binding is not None:
        scene.materials.append(FabricSurface(name=binding.fabric.name, binding=binding))
    else:
        scene.note(path.name, "is rendered grey: no fabric was given for it")
    for where, problem in file.notes:
        scene.note(_place(path, where), problem)
    pieces = [piece for piece in file.pieces if len(piece.triangles)]
    names = unique_names([_place(path, piece.name) for piece in pieces])
    # In a format without instances, no piece is a copy of another.
    instances = path.suffix.lower() in WITH_INSTANCES
    for name, piece in zip(names, pieces, strict=True):
        mesh = _mesh(scene, name, piece, metres, bound=binding is not None)
        scene.meshes.append(mesh if instances else replace(mesh, origin=name))
    if not scene.meshes:
        raise FabricError(str(path), "holds no triangles")
    note_size(scene, path, units)
    return scene


def _place(path: Path, piece: str) -> str:
    return f"{path.name}:{piece}" if piece else path.name


def _read(path: Path) -> MeshFile:
    try:
        return READERS[path.suffix.lower()](path)
    except FabricError:
        raise
    except OSError as error:
        raise FabricError(str(path), f"cannot be read: {error.strerror or error}") from error
    except Exception as error:
        # A file that is broken in a way that its reader did not foresee is still bad input.
        words = one_line(f"{type(error).__name__}: {error}", 200)
        raise FabricError(str(path), f"cannot be read as a mesh: {words}") from error


def _mesh(scene: Scene, name: str, piece: Piece, metres: float, *, bound: bool) -> Mesh:
    """A piece as a mesh in metres with its material; adds notes about what the piece lacks."""
    with np.errstate(over="ignore", invalid="ignore"):
        points = piece.points * metres
        far = np.asarray((np.abs(points) > FARTHEST).any(axis=1))
    far &= np.isfinite(points).all(axis=1)
    if far.any():
        scene.note(name, f"has {int(far.sum())} points beyond {FARTHEST:g} m, which do not count")
        points = np.where(far[:, None], np.nan, points)
    count = len(piece.triangles)
    material = np.full(count, CLOTH if bound else GREY, np.int32)
    uv = piece.uv
    if uv is None and bound:
        scene.note(name, "has no UVs; it is rendered grey instead of as a fabric")
        material[:] = GREY
    elif uv is not None and bound and piece.textured is not None:
        bare = ~piece.textured
        scene.note(
            name, f"has no UVs on {int(bare.sum())} of {count} triangles; they are rendered grey"
        )
        material[bare] = GREY
    if uv is not None:
        broken = ~np.isfinite(uv).all(axis=(1, 2))
        if broken.any():
            scene.note(
                name,
                f"has UVs that are not finite on {int(broken.sum())} triangles; they count as 0",
            )
    return Mesh(
        path=name,
        points=points,
        triangles=piece.triangles,
        normals=_normals(scene, name, piece, points),
        uv=uv,
        material=material,
    )


def _normals(
    scene: Scene, name: str, piece: Piece, points: NDArray[np.float64]
) -> NDArray[Any] | None:
    """(m, 3, 3) float32 unit normals at the corners, or None if the file gives none.

    The file's normals are turned to the side that the winding makes the front. Faces without
    normals get smooth ones.
    """
    if piece.normals is None:
        return None
    normals = np.asarray(piece.normals, np.float64)
    with np.errstate(all="ignore"):
        length = np.linalg.norm(normals, axis=2, keepdims=True)
        given = np.asarray((np.isfinite(length) & (length > 0)).all(axis=(1, 2)))
        if not given.any():
            return None
        normals = normals / np.where(given[:, None, None], length, 1.0)
        corners = points[piece.triangles]
        face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        against = given & (np.einsum("mkc,mc->m", normals, face) < 0)
    if against.any():
        scene.note(
            name,
            f"has normals that point behind its faces on {int(against.sum())} of {len(given)} "
            "triangles; they are turned to the front",
        )
        normals[against] *= -1.0
    if not given.all():
        finite = np.where(np.isfinite(points), points, 0.0)
        normals[~given] = smooth_normals(finite, piece.triangles)[~given]
    return normals.astype(np.float32)

"""Limit surfaces of Catmull-Clark cages, evaluated by Embree's subdivision geometry.

Faces are spoken to by their corners: each corner of a face owns a sub-quad, what one step of
subdivision makes of it. Its coordinate s runs from the corner to the middle of the edge that leaves
it, t to the middle of the edge that arrives, and (1, 1) is the middle of the face.

Embree subdivides around irregular points and creases ten times and closes what is left with a
Gregory patch: a crease that stays sharp is rounded within a thousandth of a cage's edge.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.scene.surface import embree_library

MOST_CORNERS = 15
"""Corners that a face may have."""

MOST_FACES, MOST_RING = 64, 128
"""Faces around a point, and their corners that are no neighbours of it along both edges; a border
counts as one more of each. Beyond that Embree writes past its arrays."""

INFINITE = 10.0
"""Sharpness from which USD and OpenSubdiv take a crease for one that never softens."""

_GEOMETRY = 8
_INDEX, _VERTEX, _FACE = 0, 1, 16
_EDGES, _EDGE_WEIGHTS, _POINTS, _POINT_WEIGHTS = 18, 19, 20, 21
_UINT, _UINT2, _FLOAT, _FLOAT3 = 0x5001, 0x5002, 0x9001, 0x9003


class _Arguments(ctypes.Structure):
    """`RTCInterpolateNArguments`."""

    _fields_ = (
        ("geometry", ctypes.c_void_p),
        ("valid", ctypes.c_void_p),
        ("primitives", ctypes.c_void_p),
        ("u", ctypes.c_void_p),
        ("v", ctypes.c_void_p),
        ("count", ctypes.c_uint),
        ("buffer", ctypes.c_int),
        ("slot", ctypes.c_uint),
        ("point", ctypes.c_void_p),
        ("along_u", ctypes.c_void_p),
        ("along_v", ctypes.c_void_p),
        ("along_uu", ctypes.c_void_p),
        ("along_vv", ctypes.c_void_p),
        ("along_uv", ctypes.c_void_p),
        ("values", ctypes.c_uint),
    )


def available() -> bool:
    """Whether surfaces can be evaluated here: embreex must ship its C library."""
    library = embree_library.library()
    return library is not None and hasattr(library, "rtcInterpolateN")


class LimitSurface:
    """The limit of one cage; boundaries run smoothly along its border.

    points : (n, 3) float, finite; counts : (f,) int, 3 to MOST_CORNERS; indices : (h,) int
    creases : (c, 2) int - points at the ends of edges, each edge once
    crease_sharpness : (c,) float, sharpness : (n,) float - at least 0; from INFINITE on for ever

    The caller must keep to MOST_FACES and MOST_RING. Raises `FabricError` where Embree refuses.
    """

    def __init__(
        self,
        points: NDArray[Any],
        counts: NDArray[Any],
        indices: NDArray[Any],
        creases: NDArray[Any],
        crease_sharpness: NDArray[Any],
        sharpness: NDArray[Any],
    ) -> None:
        self._library = _library()
        self._counts = np.ascontiguousarray(counts, np.uint32)
        starts = np.cumsum(counts) - counts
        self._face = np.repeat(np.arange(len(counts)), counts)
        self._corner = np.arange(len(indices)) - starts[self._face]
        # Float32 is spent on the shape, wherever it lies.
        used = points[indices]
        low, high = used.min(axis=0), used.max(axis=0)
        self._middle = 0.5 * (low + high)
        self._scale = float((high - low).max()) or 1.0
        # Embree reads 16 bytes for the last vertex.
        vertices = np.zeros((len(points) + 1, 3), np.float32)
        vertices[:-1] = (points - self._middle) / self._scale
        sharp = np.flatnonzero(sharpness > 0)
        self._buffers = [
            (_VERTEX, _FLOAT3, vertices, len(points)),
            (_FACE, _UINT, self._counts, len(counts)),
            (_INDEX, _UINT, np.ascontiguousarray(indices, np.uint32), len(indices)),
            (_EDGES, _UINT2, np.ascontiguousarray(creases, np.uint32), len(creases)),
            (_EDGE_WEIGHTS, _FLOAT, _weights(crease_sharpness), len(creases)),
            (_POINTS, _UINT, sharp.astype(np.uint32), len(sharp)),
            (_POINT_WEIGHTS, _FLOAT, _weights(sharpness[sharp]), len(sharp)),
        ]
        self._device = self._library.rtcNewDevice(b"")
        if not self._device:
            raise FabricError("Embree", "gives no device on this processor")
        self._geometry = self._library.rtcNewGeometry(self._device, _GEOMETRY)
        for kind, layout, data, count in self._buffers:
            if count:
                stride = 4 * (1 if data.ndim == 1 else data.shape[1])
                self._library.rtcSetSharedGeometryBuffer(
                    self._geometry, kind, 0, layout, data.ctypes.data, 0, stride, count
                )
        self._library.rtcCommitGeometry(self._geometry)
        error = self._library.rtcGetDeviceError(self._device)
        if error:
            raise FabricError("Embree", f"refuses a cage of {len(counts)} faces ({error})")

    def evaluate(
        self, corners: NDArray[Any], s: NDArray[Any], t: NDArray[Any], *, normals: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
        """Points of the surface, and the cross products of its derivatives where asked for.

        corners : (k,) int - position in `indices`; s, t : (k,) float in [0, 1]
        Returns (k, 3) points and (k, 3) normals of any length, right-handed, or None.
        """
        count = len(corners)
        padded = -(-count // 4) * 4
        faces = np.zeros(padded, np.uint32)
        faces[:count] = self._face[corners]
        uv = np.zeros((2, padded), np.float32)
        uv[:, :count] = self._coordinates(corners, s, t)
        found = np.empty((3 if normals else 1, 3, padded), np.float32)
        pointers = [part.ctypes.data for part in found] + [None] * (3 - len(found))
        arguments = _Arguments(
            geometry=self._geometry, primitives=faces.ctypes.data, u=uv[0].ctypes.data,
            v=uv[1].ctypes.data, count=padded, buffer=_VERTEX, point=pointers[0],
            along_u=pointers[1], along_v=pointers[2], values=3,
        )  # fmt: skip
        self._library.rtcInterpolateN(ctypes.addressof(arguments))
        values = found[:, :, :count].astype(np.float64)
        points = values[0].T * self._scale + self._middle
        return points, np.cross(values[1].T, values[2].T) if normals else None

    def _coordinates(self, corners: NDArray[Any], s: Any, t: Any) -> NDArray[np.float64]:
        """(2, k) Embree's u and v: over the whole of a quad, else with the sub-quad's number."""
        corner = self._corner[corners]
        quad = self._counts[self._face[corners]] == 4
        a, b = 0.5 * s, 0.5 * t
        u = np.choose(corner % 4, [a, 1 - b, 1 - a, b])
        v = np.choose(corner % 4, [b, a, 1 - b, 1 - a])
        return np.stack(
            [
                np.where(quad, u, 2 * (corner % 4) + 0.5 + s),
                np.where(quad, v, 2 * (corner // 4) + 0.5 + t),
            ]
        )

    def __del__(self) -> None:
        if getattr(self, "_geometry", None):
            self._library.rtcReleaseGeometry(self._geometry)
        if getattr(self, "_device", None):
            self._library.rtcReleaseDevice(self._device)


def _library() -> ctypes.CDLL:
    library = embree_library.library()
    if library is None:
        raise FabricError("Embree", "has no C library here, which limit surfaces need")
    embree_library.declare(library, (("rtcInterpolateN", None, ctypes.c_void_p),))
    return library


def _weights(sharpness: NDArray[Any]) -> NDArray[np.float32]:
    return np.where(sharpness >= INFINITE, np.inf, sharpness).astype(np.float32)

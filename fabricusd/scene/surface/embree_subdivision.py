"""Limit surfaces of Catmull-Clark cages, evaluated by Embree's subdivision geometry.

Faces are addressed by their corners: each corner of a face owns a sub-quad, the quad that one
subdivision step makes at that corner. Its coordinate s runs from the corner to the midpoint of the
edge that leaves the corner, t to the midpoint of the edge that arrives, and (1, 1) is the middle of
the face.

Embree subdivides ten times around irregular points and creases and closes the remaining hole with a
Gregory patch. A crease that stays sharp is therefore rounded within a thousandth of a cage's edge.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.scene.surface import embree_library

MOST_CORNERS = 15
"""Largest number of corners of a face."""

MOST_FACES, MOST_RING = 64, 128
"""Limits on the number of faces around a point, and on the number of those faces' corners that are
not neighbours of the point along both edges; a border adds one to each. Beyond these limits Embree
writes past its arrays."""

INFINITE = 10.0
"""Sharpness from which on USD and OpenSubdiv treat a crease as infinitely sharp."""

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
    """Whether limit surfaces can be evaluated: embreex must ship Embree's C library."""
    library = embree_library.library()
    return library is not None and hasattr(library, "rtcInterpolateN")


class LimitSurface:
    """The limit surface of one cage; its boundaries follow the cage's border smoothly.

    points : (n, 3) float, finite; counts : (f,) int, 3 to MOST_CORNERS; indices : (h,) int
    creases : (c, 2) int - points at the ends of edges, each edge once
    crease_sharpness : (c,) float, sharpness : (n,) float - at least 0; infinitely sharp from
        INFINITE on

    The caller must respect MOST_FACES and MOST_RING. Raises `FabricError` if Embree refuses the
    cage.
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
        # Centre and scale the cage, so that float32 resolves its shape wherever it lies.
        used = points[indices]
        low, high = used.min(axis=0), used.max(axis=0)
        self._middle = 0.5 * (low + high)
        self._scale = float((high - low).max()) or 1.0
        # Embree reads 16 bytes per vertex, also for the last one.
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
        """Evaluate points of the surface and, if `normals`, the cross products of its derivatives.

        corners : (k,) int - positions in `indices`; s, t : (k,) float in [0, 1]
        Returns (k, 3) points, and (k, 3) right-handed normals of any length or None.
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
        """(2, k) Embree's u and v: over a whole quad, or with the sub-quad's number otherwise."""
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
        raise FabricError("Embree", "has no C library here, and limit surfaces need one")
    embree_library.declare(library, (("rtcInterpolateN", None, ctypes.c_void_p),))
    return library


def _weights(sharpness: NDArray[Any]) -> NDArray[np.float32]:
    return np.where(sharpness >= INFINITE, np.inf, sharpness).astype(np.float32)

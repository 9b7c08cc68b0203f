"""Nearest hits and occlusion through Embree 4, in packets of 16 rays.

Compiled kernels call the C library of the embreex wheel by name, without the Python interpreter in
between. If the library is not found, embreex's own Python interface traces the same rays, more
slowly. `scene.surface.embree_library` finds the library; limit surfaces use it as well.

Rays are stored as Embree's `RTCRayHit16`: an array (packets, ROWS, 16) float32 whose rows are named
below; rows 9, 10, 11, 17, 18, ... hold unsigned integers. Embree skips a lane whose `TFAR` is below
its `TNEAR`, so packets that are not full are padded with such lanes.
"""

from __future__ import annotations

import ctypes
import importlib.metadata
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from llvmlite import binding
from numba import njit, types
from numpy.typing import NDArray

import fabricusd.kernels  # noqa: F401 - chooses where kernels are cached
from fabricusd.errors import FabricError
from fabricusd.kernels.calls import Calls
from fabricusd.scene.surface.embree_library import PATH, library

LANES = 16
ROWS = 24
RAY_ROWS = 12
"""Rows of the ray itself; the others are those of its hit."""
"""Rows of a packet: 21 in Embree 4.4 with instance arrays; the rest is room for later versions."""

OX, OY, OZ, TNEAR, DX, DY, DZ, TIME, TFAR, MASK, ID, FLAGS = range(12)
NGX, NGY, NGZ, HIT_U, HIT_V, PRIMITIVE, GEOMETRY, INSTANCE, INSTANCE_PRIMITIVE = range(12, 21)

MISS = np.uint32(0xFFFFFFFF)
"""`PRIMITIVE` and `GEOMETRY` of a ray that hit nothing."""

INFINITE_DISTANCE = np.float32(1e30)
"""`TFAR` of a ray without end, and the distance to a light at infinity."""
ENDLESS = np.float32(1e29)
"""Distance from which on a ray counts as having hit nothing."""

_FLOAT3, _UINT3, _ROWS_3X4 = 0x9003, 0x5003, 0x9134
_ROBUST = 4
_TRIANGLES, _INSTANCES = 0, 122
_INDEX, _VERTEX, _TRANSFORM = 0, 1, 23
_VERSION, _NATIVE16 = 0, 34
_COHERENT = 1 << 16
_ALL_FEATURES = 0xFFFFFFFF


class _Arguments(ctypes.Structure):
    """`RTCIntersectArguments` and `RTCOccludedArguments`, which have the same layout."""

    _fields_ = (
        ("flags", ctypes.c_uint32),
        ("feature_mask", ctypes.c_uint32),
        ("context", ctypes.c_void_p),
        ("filter", ctypes.c_void_p),
        ("function", ctypes.c_void_p),
        ("min_width", ctypes.c_float),
    )


_TOGETHER = _Arguments(flags=_COHERENT, feature_mask=_ALL_FEATURES)
"""Arguments that make Embree traverse the hierarchy with all rays of a packet together instead of
one ray after the other."""
_TOGETHER_AT = ctypes.addressof(_TOGETHER)


_LIBRARY = library()
if _LIBRARY is not None:
    try:
        # Kernels find these functions by name, including kernels loaded from numba's disk cache.
        binding.load_library_permanently(PATH)
    except RuntimeError:
        _LIBRARY = None


_trace16 = types.void(types.uintp, types.uintp, types.uintp, types.uintp)
_rtcIntersect16 = types.ExternalFunction("rtcIntersect16", _trace16)
_rtcOccluded16 = types.ExternalFunction("rtcOccluded16", _trace16)


@njit(cache=True, nogil=True)
def _intersect_packets(scene, valid, arguments, rays, count):
    base = rays.ctypes.data
    stride = rays.strides[0]
    for p in range(count):
        _rtcIntersect16(valid, scene, base + p * stride, arguments)


@njit(cache=True, nogil=True)
def _occluded_packets(scene, valid, arguments, rays, count):
    base = rays.ctypes.data
    stride = rays.strides[0]
    for p in range(count):
        _rtcOccluded16(valid, scene, base + p * stride, arguments)


_trace1 = types.void(types.uintp, types.uintp, types.uintp)
_rtcIntersect1 = types.ExternalFunction("rtcIntersect1", _trace1)
_rtcOccluded1 = types.ExternalFunction("rtcOccluded1", _trace1)


@njit(cache=True, nogil=True)
def _trace_rays(scene, rays, count, occlusion):
    """Trace the active rays of `count` packets one at a time, as `RTCRayHit` or `RTCRay`."""
    room = np.empty(ROWS + 4, np.float32)
    one = room[(-room.ctypes.data % 16) // 4 :]
    names = one.view(np.uint32)
    base = one.ctypes.data
    for p in range(count):
        for lane in range(LANES):
            if rays[p, TFAR, lane] < rays[p, TNEAR, lane]:
                continue
            for row in range(RAY_ROWS):
                one[row] = rays[p, row, lane]
            if occlusion:
                _rtcOccluded1(scene, base, np.uint64(0))
                rays[p, TFAR, lane] = one[TFAR]
                continue
            names[GEOMETRY] = MISS
            _rtcIntersect1(scene, base, np.uint64(0))
            if names[GEOMETRY] != MISS:
                rays[p, TFAR, lane] = one[TFAR]
                for row in range(RAY_ROWS, INSTANCE_PRIMITIVE + 1):
                    rays[p, row, lane] = one[row]


def aligned_empty(shape: tuple[int, ...], dtype: Any = np.float32) -> NDArray[Any]:
    """An uninitialised C-contiguous array, aligned to 64 bytes."""
    wanted = np.dtype(dtype)
    size = int(np.prod(shape)) * wanted.itemsize
    raw = np.empty(size + 64, np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start : start + size].view(wanted).reshape(shape)


def new_packets(rays: int) -> NDArray[np.float32]:
    """Packets for `rays` rays: (ceil(rays / 16), ROWS, 16) float32, with every lane inactive."""
    packets = aligned_empty(((rays + LANES - 1) // LANES, ROWS, LANES))
    packets[:] = 0.0
    packets[:, TFAR] = -1.0
    packets.view(np.uint32)[:, MASK] = 0xFFFFFFFF
    return packets


@cache
def has_instances() -> bool:
    """Whether the library traces arrays of instances."""
    if _LIBRARY is None:
        return False
    device = _LIBRARY.rtcNewDevice(b"")
    if not device:
        return False
    array = _LIBRARY.rtcNewGeometry(device, _INSTANCES)
    if array:
        _LIBRARY.rtcReleaseGeometry(array)
    known = bool(array) and not _LIBRARY.rtcGetDeviceError(device)
    _LIBRARY.rtcReleaseDevice(device)
    return known


class Accelerator:
    """An acceleration structure over triangles; several workers may trace rays at once.

    points : (n, 3) float, triangles : (m, 3) int
    groups : triangles that are instanced, behind all others: first, count, and the same of
        `placements`, (k, 3, 4) float32; only if `has_instances()`
    begins : (geometries, 2) int64 - the first triangle and the first placement of each geometry
        that INSTANCE names

    Raises `FabricError` if Embree refuses them.
    """

    def __init__(
        self,
        points: NDArray[Any],
        triangles: NDArray[Any],
        groups: Sequence[Any] = (),
        placements: NDArray[np.float32] | None = None,
    ) -> None:
        # Embree reads 16 bytes per vertex, also for the last one.
        self._points = np.zeros((len(points) + 1, 3), np.float32)
        self._points[:-1] = points
        self._triangles = np.ascontiguousarray(triangles, np.uint32)
        self._device = self._scene = 0
        self._python: Any = None
        self._call = Calls()
        self.begins = np.zeros((len(groups) + 1, 2), np.int64)
        if _LIBRARY is None:
            self._python = _python_scene(self._points[:-1], self._triangles)
            return
        self._device = _LIBRARY.rtcNewDevice(b"")
        if not self._device:
            raise FabricError("Embree", "gives no device on this processor")
        self._placements = placements if groups else None
        self._scene = self._new_scene()
        ordinary = len(self._triangles) - sum(group.count for group in groups)
        if ordinary or not groups:
            self._attach_triangles(self._scene, 0, ordinary)
        for group in groups:
            self._attach_instances(group)
        _LIBRARY.rtcCommitScene(self._scene)
        error = _LIBRARY.rtcGetDeviceError(self._device)
        if error:
            raise FabricError("Embree", f"refuses the scene's {len(triangles)} triangles ({error})")
        self._valid = aligned_empty((LANES,), np.int32)
        self._valid[:] = -1
        self._valid_at = self._valid.ctypes.data

    def _new_scene(self) -> int:
        scene: int = _LIBRARY.rtcNewScene(self._device)  # type: ignore[union-attr]
        _LIBRARY.rtcSetSceneFlags(scene, _ROBUST)  # type: ignore[union-attr]
        return scene

    def _attach_triangles(self, scene: int, first: int, count: int) -> None:
        assert _LIBRARY is not None
        mesh = _LIBRARY.rtcNewGeometry(self._device, _TRIANGLES)
        for kind, layout, data, begin, number in (
            (_VERTEX, _FLOAT3, self._points, 0, len(self._points) - 1),
            (_INDEX, _UINT3, self._triangles, first, count),
        ):
            _LIBRARY.rtcSetSharedGeometryBuffer(
                mesh, kind, 0, layout, data.ctypes.data, 12 * begin, 12, number
            )
        self._attach(scene, mesh)

    def _attach_instances(self, group: Any) -> None:
        """Place a group's triangles, in a scene of their own, wherever they are instanced."""
        assert _LIBRARY is not None
        assert self._placements is not None
        alone = self._new_scene()
        self._attach_triangles(alone, group.first, group.count)
        _LIBRARY.rtcCommitScene(alone)
        array = _LIBRARY.rtcNewGeometry(self._device, _INSTANCES)
        _LIBRARY.rtcSetGeometryInstancedScene(array, alone)
        _LIBRARY.rtcSetSharedGeometryBuffer(
            array, _TRANSFORM, 0, _ROWS_3X4, self._placements.ctypes.data, 48 * group.first_place,
            48, group.places,
        )  # fmt: skip
        self.begins[self._attach(self._scene, array)] = group.first, group.first_place
        _LIBRARY.rtcReleaseScene(alone)

    def _attach(self, scene: int, geometry: int) -> int:
        assert _LIBRARY is not None
        _LIBRARY.rtcCommitGeometry(geometry)
        number: int = _LIBRARY.rtcAttachGeometry(scene, geometry)
        _LIBRARY.rtcReleaseGeometry(geometry)
        return number

    @property
    def version(self) -> str:
        """The version of Embree, and whether the processor supports packets of 16 natively."""
        if _LIBRARY is None:
            return f"embreex {importlib.metadata.version('embreex')}"
        number = _LIBRARY.rtcGetDeviceProperty(self._device, _VERSION)
        native = bool(_LIBRARY.rtcGetDeviceProperty(self._device, _NATIVE16))
        words = f"{number // 10000}.{number // 100 % 100}.{number % 100}"
        return f"Embree {words}, packets of 16 {'native' if native else 'emulated'}"

    def intersect(self, rays: NDArray[np.float32], count: int, *, coherent: bool = False) -> None:
        """Find the nearest hits of the first `count` packets and write TFAR and the hit rows.

        The caller sets GEOMETRY to MISS beforehand. A miss leaves TFAR and GEOMETRY unchanged.

        coherent : whether the rays of each packet run side by side, as a camera's do; tracing then
            takes a fifth of the time, but twice the time if they do not

        Among instances, rays that do not run side by side are traced one at a time: a packet would
        visit every instance that any of its rays meets.
        """
        if self._python is not None:
            _python_trace(self._python, rays, count, occlusion=False)
            return
        if self._placements is not None and not coherent:
            self._call(_trace_rays, self._scene, rays, count, False)
            return
        together = coherent and self._placements is None
        arguments = _TOGETHER_AT if together else 0
        self._call(_intersect_packets, self._scene, self._valid_at, arguments, rays, count)

    def occluded(self, rays: NDArray[np.float32], count: int) -> None:
        """Set TFAR to -inf for each blocked ray of the first `count` packets."""
        if self._python is not None:
            _python_trace(self._python, rays, count, occlusion=True)
            return
        if self._placements is not None:
            self._call(_trace_rays, self._scene, rays, count, True)
            return
        self._call(_occluded_packets, self._scene, self._valid_at, 0, rays, count)

    def __del__(self) -> None:
        if _LIBRARY is not None and getattr(self, "_scene", False):
            _LIBRARY.rtcReleaseScene(self._scene)
            _LIBRARY.rtcReleaseDevice(self._device)


def _python_scene(points: NDArray[np.float32], triangles: NDArray[np.uint32]) -> Any:
    """The triangles as a scene of embreex's Python interface."""
    try:
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh
    except ImportError:
        raise FabricError("Embree", "is not installed; `pip install embreex` brings it") from None
    scene = rtcore_scene.EmbreeScene(robust=True)
    TriangleMesh(scene, points, triangles.astype(np.int32))
    return scene


def _python_trace(scene: Any, rays: NDArray[np.float32], count: int, *, occlusion: bool) -> None:
    """`intersect` or `occluded` through embreex, whose rays always start at their origin."""
    block = rays[:count]
    near, far = block[:, TNEAR], block[:, TFAR]
    active = near <= far
    direction = np.stack([block[:, r][active] for r in (DX, DY, DZ)], axis=1)
    start = near[active]
    origin = np.stack([block[:, r][active] for r in (OX, OY, OZ)], axis=1)
    origin = origin + start[:, None] * direction
    reach = (far[active] - start).astype(np.float32)
    if not len(origin):
        return
    hit = scene.run(origin, direction, np.minimum(reach, INFINITE_DISTANCE), output=True)
    found = (hit["primID"] != -1) & (hit["tfar"] <= reach)
    if occlusion:
        far[active] = np.where(found, np.float32(-np.inf), far[active])
        return
    far[active] = np.where(found, hit["tfar"] + start, far[active])
    whole = block.view(np.uint32)
    for row, value in ((PRIMITIVE, hit["primID"]), (GEOMETRY, np.zeros(len(found)))):
        whole[:, row][active] = np.where(found, value, MISS).astype(np.uint32)
    for row, value in ((HIT_U, hit["u"]), (HIT_V, hit["v"])):
        block[:, row][active] = value
    for axis, row in enumerate((NGX, NGY, NGZ)):
        block[:, row][active] = hit["Ng"][:, axis]

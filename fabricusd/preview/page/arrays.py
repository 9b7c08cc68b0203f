"""Arrays and meshes as the page's JSON holds them."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.preview.shapes import Shape


def mesh_arrays(shape: Shape) -> dict[str, Any]:
    """A mesh as the page takes it: vertices that corners share, in 16 bits but for `metres`."""
    low, high = shape.points.min(axis=(0, 1)), shape.points.max(axis=(0, 1))
    extent = np.maximum(high - low, 1e-9)
    hand = np.repeat(np.sign(shape.hand)[:, None, None], 3, axis=1)
    places = np.rint((shape.points - low) / extent * 65535.0)
    turned = np.concatenate((shape.tangents, hand), axis=-1)
    corners = np.concatenate(
        (places, np.rint(shape.normals * 32767.0), np.rint(turned * 32767.0)), axis=-1
    )
    rows = np.concatenate((corners, shape.metres.astype(np.float32)), axis=-1).reshape(-1, 12)
    single, number = np.unique(rows, axis=0, return_inverse=True)
    padded = np.zeros((len(single), 4))
    camera = shape.camera()
    subject = shape.subject

    def four(columns: NDArray[np.float64]) -> NDArray[np.float64]:
        out = padded.copy()
        out[:, : columns.shape[1]] = columns
        return out

    return {
        "places": array(four(single[:, :3]), "u2"), "normals": array(four(single[:, 3:6]), "i2"),
        "tangents": array(single[:, 6:10], "i2"), "metres": array(single[:, 10:], "f4"),
        "indices": array(number.reshape(-1), "u4"), "low": low.tolist(),
        "extent": extent.tolist(), "convex": shape.convex, "centre": subject.centre.tolist(),
        "radius": subject.radius, "towards": list(shape.towards),
        "distance": float(np.linalg.norm(camera.frame[:3, 3] - subject.centre)),
    }  # fmt: skip


def array(values: Any, kind: str) -> dict[str, str]:
    """An array as JSON: its type, and little-endian bytes in base64."""
    data = np.ascontiguousarray(values).astype(np.dtype(kind).newbyteorder("<"))
    return {"type": kind, "data": base64.b64encode(data.tobytes()).decode()}

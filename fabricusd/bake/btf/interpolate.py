"""Interpolate a BTF between its directions and between its texels."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import Delaunay, QhullError

from fabricusd.bake.btf.factors import Factors
from fabricusd.errors import FabricError

Floats = NDArray[np.float64]


def direction_weights(directions: Floats, w: ArrayLike) -> tuple[NDArray[np.int64], Floats]:
    """(3,) indices of the directions around unit vector `w` (3,), and (3,) weights that sum to 1.

    Weights are barycentric in the plane x/(1+z), y/(1+z). A direction below the lowest ring is
    moved towards the pole until it lies inside the ring.
    """
    flat = directions[:, :2] / (1.0 + directions[:, 2:])
    target = np.asarray(w, np.float64)
    if target.shape != (3,) or not target[2] > 0:
        raise FabricError("direction", f"is {target.tolist()}; it must point above the cloth")
    place = target[:2] / (1.0 + target[2])
    mesh = _mesh(flat.tobytes(), len(flat))
    found = int(mesh.find_simplex(place))
    for _ in range(64):
        if found >= 0:
            break
        # Outside the lowest ring: move towards the pole until inside.
        place = place * 0.99
        found = int(mesh.find_simplex(place))
    if found < 0:
        raise FabricError("directions", "do not surround the pole; the directions of a BTF must")
    corner = mesh.transform[found]
    two = corner[:2] @ (place - corner[2])
    weights = np.clip(np.array([two[0], two[1], 1.0 - two.sum()]), 0.0, 1.0)
    return np.asarray(mesh.simplices[found], np.int64), weights / weights.sum()


@lru_cache(maxsize=8)
def _mesh(data: bytes, count: int) -> Delaunay:
    try:
        return Delaunay(np.frombuffer(data).reshape(count, 2))
    except QhullError:
        raise FabricError(
            "directions", "lie on one line; the directions of a BTF must surround the pole"
        ) from None


def texel_weights(
    weave: Floats, size: tuple[int, int], per_thread: int
) -> tuple[NDArray[np.int64], Floats]:
    """(n, 4) indices of the texels around weave coordinates (n, 2), and their bilinear weights.

    Coordinates wrap around at the ends of the repeat.
    """
    h, w = size
    place = np.mod(np.asarray(weave, np.float64), np.array([w, h]) / per_thread) * per_thread - 0.5
    low = np.floor(place).astype(np.int64)
    f = place - low
    texels, weights = [], []
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        x, y = (low[:, 0] + dx) % w, (low[:, 1] + dy) % h
        texels.append(y * w + x)
        fx = f[:, 0] if dx else 1.0 - f[:, 0]
        weights.append(fx * (f[:, 1] if dy else 1.0 - f[:, 1]))
    return np.stack(texels, axis=1), np.stack(weights, axis=1)


def evaluate(
    directions: Floats, made: Factors, size: tuple[int, int], per_thread: int,
    weave: ArrayLike, wi: ArrayLike, wo: ArrayLike,
) -> Floats:  # fmt: skip
    """(n, 3) radiance per unit `L_i dwi` at weave coordinates (n, 2), cosine included."""
    lights, light_shares = direction_weights(directions, wi)
    views, view_shares = direction_weights(directions, wo)
    pairs = (views[:, None] * len(directions) + lights[None, :]).ravel()
    shares = (view_shares[:, None] * light_shares[None, :]).ravel()
    texels, weights = texel_weights(np.asarray(weave, np.float64), size, per_thread)
    channels = []
    for u, c in zip(made.rows, made.columns, strict=True):
        mixed = np.einsum("p,pcr->cr", shares, u[pairs].astype(np.float64))
        column = np.einsum("nk,nkr->nr", weights, c[texels].astype(np.float64))
        channels.append(column @ mixed.T)
    values = channels[0] if len(channels) == 1 else np.concatenate(channels, axis=1)
    return np.asarray(np.maximum(values, 0.0) * float(np.asarray(wi)[2]))

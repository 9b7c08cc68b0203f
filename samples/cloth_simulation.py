"""A small cloth simulation: a grid of points with distance constraints falls onto a body.

It uses position-based dynamics [Muller2007]: points move under gravity, then every distance is
restored in turn, and points inside the body are pushed out. The distances are sorted into groups in
which no two share a point, so that each group is one array operation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
Body = Callable[[Points], Points]
"""Moves points that are inside a solid to its surface."""


@dataclass(frozen=True, eq=False)
class _Group:
    """Disjoint pairs of points, their rest distance, and the share of its error that one pass
    removes."""

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    rest: NDArray[np.float64]
    stiffness: float


def simulate(
    points: Points,
    rest: Points,
    body: Body,
    *,
    pinned: NDArray[np.bool_] | None = None,
    around: bool = False,
    steps: int = 600,
    passes: int = 12,
    substeps: int = 1,
    bending: float = 0.03,
    thickness: float = 0.004,
) -> Points:
    """Let a grid of cloth fall until it hangs at rest.

    points : (m, n, 3) [m] - initial positions; +y is up
    rest : (m, n, 2) or (m, n, 3) [m] - the same grid without tension, flat or as it starts
    pinned : (m, n) bool - points that do not move
    around : whether the grid closes on itself along its first axis
    passes : how often distances are restored per substep
    substeps : number of substeps per step; for the same cost, many substeps of one pass keep the
        cloth from stretching [Macklin2019]
    bending : stiffness between points that are two apart, 0 for a membrane, 1 for a board

    Returns (m, n, 3) [m].
    """
    groups = _groups(points.shape[:2], rest, around, bending)
    shape = points.shape
    x = points.reshape(-1, 3).copy()
    fixed = np.zeros(len(x), bool) if pinned is None else pinned.ravel()
    weight = np.where(fixed, 0.0, 1.0)
    before = x.copy()
    step = 1.0 / 60.0 / substeps
    for k in range(steps * substeps):
        # More damping towards the end, so that it comes to rest.
        damping = (0.985 if k < 0.6 * steps * substeps else 0.93) ** (1.0 / substeps)
        moved = x + damping * (x - before)
        moved[~fixed, 1] -= 9.81 * step**2
        before = x
        x = moved
        for _ in range(passes):
            for group in groups:
                _restore(x, weight, group)
            pushed = body(x)
            touching = np.abs(pushed - x).max(axis=1) > 0
            x = np.where(fixed[:, None], x, pushed)
            # Friction: a point that touches the body loses most of its motion along it.
            held = touching & ~fixed
            before[held] += 0.6 * (x[held] - before[held])
        x[:, 1] = np.maximum(x[:, 1], thickness)
    return x.reshape(shape)


def _restore(x: Points, weight: NDArray[np.float64], group: _Group) -> None:
    d = x[group.second] - x[group.first]
    length = np.sqrt(np.einsum("ij,ij->i", d, d)) + 1e-12
    share = weight[group.first] + weight[group.second]
    pull = group.stiffness * (length - group.rest) / (length * np.maximum(share, 1e-12))
    d *= pull[:, None]
    x[group.first] += weight[group.first][:, None] * d
    x[group.second] -= weight[group.second][:, None] * d


def _groups(
    shape: tuple[int, ...], rest: NDArray[np.float64], around: bool, bending: float
) -> list[_Group]:
    m, n = shape[0], shape[1]
    index = np.arange(m * n).reshape(m, n)
    groups = []
    for di, dj, stiffness in (
        (1, 0, 1.0), (0, 1, 1.0), (1, 1, 0.25), (1, -1, 0.25), (2, 0, bending), (0, 2, bending),
    ):  # fmt: skip
        i, j = np.meshgrid(np.arange(m), np.arange(n), indexing="ij")
        i2, j2 = i + di, j + dj
        inside = (j2 >= 0) & (j2 < n) & ((i2 < m) | around)
        i2 = i2 % m
        # Pairs two apart need four groups along their axis, pairs one apart two; a ring may need
        # more.
        period = 2 * max(di, abs(dj))
        color = (i if di else j) // max(di, abs(dj)) % 2
        for c in range(2):
            for part in range(max(period // 2, 1)):
                along = (i if di else j) % max(period // 2, 1) == part
                chosen = inside & (color == c) & along
                a, b = index[chosen], index[i2[chosen], j2[chosen]]
                # In a ring of odd length the last pairs meet the first, so they form a group.
                unique = np.isin(b, a, invert=True)
                for keep in (unique, ~unique):
                    if keep.any():
                        p, q = rest.reshape(m * n, -1)[a[keep]], rest.reshape(m * n, -1)[b[keep]]
                        groups.append(
                            _Group(a[keep], b[keep], np.linalg.norm(q - p, axis=1), stiffness)
                        )
    return groups


def drum_body(radius: float, height: float, edge: float) -> Body:
    """An upright drum of `radius` from the floor to `height`, its upper rim rounded by `edge`."""

    def push(x: Points) -> Points:
        flat = np.hypot(x[:, 0], x[:, 2])
        out = x.copy()
        inside = (flat < radius) & (x[:, 1] < height)
        rim = inside & (flat > radius - edge) & (x[:, 1] > height - edge)
        up = inside & ~rim & (height - x[:, 1] <= radius - flat)
        side = inside & ~rim & ~up
        out[up, 1] = height
        out[side, 0] *= radius / np.maximum(flat[side], 1e-9)
        out[side, 2] *= radius / np.maximum(flat[side], 1e-9)
        da, dy = flat[rim] - (radius - edge), x[rim, 1] - (height - edge)
        length = np.hypot(da, dy)
        reach = np.where(length < edge, edge / np.maximum(length, 1e-9), 1.0)
        wide = (radius - edge + da * reach) / np.maximum(flat[rim], 1e-9)
        out[rim, 0] *= wide
        out[rim, 2] *= wide
        out[rim, 1] = height - edge + dy * reach
        return out

    return push


def turned_body(heights: NDArray[np.float64], radii: NDArray[np.float64], depth: float) -> Body:
    """A body of elliptic sections: `radii` (k, 2) half widths along x and z at `heights` (k,)."""

    def push(x: Points) -> Points:
        a = np.interp(x[:, 1], heights, radii[:, 0]) + depth
        b = np.interp(x[:, 1], heights, radii[:, 1]) + depth
        level = np.sqrt((x[:, 0] / a) ** 2 + (x[:, 2] / b) ** 2) + 1e-12
        inside = (level < 1) & (x[:, 1] > heights[0]) & (x[:, 1] < heights[-1])
        out = x.copy()
        out[inside, 0] /= level[inside]
        out[inside, 2] /= level[inside]
        return out

    return push

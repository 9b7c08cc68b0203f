"""The threads of a look as nodes: what a texel shows, and the lobes of that texel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .nodes import Group
from .threads import PARTS, Rows, Threads, Turning

EPSILON = 1e-3
"""Variance of an angle [rad^2] that is as good as none."""

STEEPEST = 1.5
"""Largest tilt [rad]."""

THIN = 1e-6
"""Share of a texel that is as good as none."""

LEAST_HALF = 1.001 * 2.0**-15
"""Just above what Cycles reads where a 16-bit texture holds 0."""

SETS = tuple(part // (PARTS // 2) for part in range(PARTS))


class Texel:
    """Sockets of what the texel under a point shows.

    shares : of each part, None for a part that the cloth has not
    sets : share of the weft and of the warp
    cover : their sum
    """

    def __init__(self, group: Group, threads: Threads, images: dict[str, Any]) -> None:
        self.group, self.threads = group, threads
        where = _place(group, threads)
        read: dict[str, Any] = {}
        for name, image in images.items():
            color, alpha = group.tiled(image, where, repeats=bool(threads.matrix))
            read[name] = color if "tint" in name else (color, alpha)
        self.shares = [
            one if known > 0.0 else None
            for one, known in zip(
                [x for noun in ("weft", "warp") for x in _four(group, read[f"lobes_{noun}"])],
                threads.share,
                strict=True,
            )
        ]
        self.shares = [None if one is None else _from_0(group, one) for one in self.shares]
        self.sets = [self._sum(range(k * PARTS // 2, (k + 1) * PARTS // 2)) for k in (0, 1)]
        self.cover = group.math("ADD", *self.sets)
        first_second = _four(group, read["lobes_lean"])
        self.angles: list[Any] = [None] * PARTS
        self.squares: list[Any] = [None] * PARTS
        for k in (0, 1):
            size = group.math("MAXIMUM", self.sets[k], THIN)
            lean = group.math("DIVIDE", first_second[2 * k], size)
            spread = _from_0(group, first_second[2 * k + 1])
            spread = group.math("DIVIDE", spread, size)
            flat = group.math("MULTIPLY", lean, lean)
            within = group.math("MAXIMUM", group.math("SUBTRACT", spread, flat), 0.0)
            for b in range(PARTS):
                if SETS[b] == k and self.shares[b] is not None:
                    self.angles[b] = group.math("ADD", lean, threads.angle[b])
                    self.squares[b] = group.math(
                        "MULTIPLY_ADD", self.angles[b], self.angles[b], within
                    )
        self.tints = [
            self._tint(k, read.get(f"lobes_{noun}_tint")) for k, noun in enumerate(("weft", "warp"))
        ]

    def color(self, rows: Rows) -> Any:
        """Return the sum of the rows (8, 3), times the shares and the tints."""
        total: Any = (0.0, 0.0, 0.0)
        for k in (0, 1):
            mine: Any = None
            for b, row in enumerate(rows):
                if SETS[b] != k or self.shares[b] is None or max(row) <= 0.0:
                    continue
                if mine is None:
                    mine = self.group.vector("MULTIPLY", row, self.shares[b])
                else:
                    mine = self.group.vector("MULTIPLY_ADD", row, self.shares[b], mine)
            if mine is None:
                continue
            if self.tints[k] is not None:
                mine = self.group.vector("MULTIPLY", mine, self.tints[k])
            total = mine if isinstance(total, tuple) else self.group.vector("ADD", total, mine)
        return total

    def placed(self, known: Turning, tilt: Any, alpha: Any, own: float) -> tuple[Any, Any]:
        """Return the tilt of a lobe in the texel, and its width along the thread."""
        math = self.group.math
        weights = [
            math("MULTIPLY", self.shares[b], m) if m > 0.0 and self.shares[b] is not None else None
            for b, m in enumerate(known.membership)
        ]
        mine = [b for b, m in enumerate(known.own) if m > 0.0 and weights[b] is not None]
        if not mine:
            return tilt, alpha
        total = self._weighted(weights, mine, None)
        every = self._weighted(weights, [b for b, w in enumerate(weights) if w is not None], None)
        share = math("DIVIDE", total, math("MAXIMUM", every, 1e-12))
        total = math("MAXIMUM", total, 1e-12)
        mean = math("DIVIDE", self._weighted(weights, mine, self.angles), total)
        square = math("DIVIDE", self._weighted(weights, mine, self.squares), total)
        variance = math("SUBTRACT", square, math("MULTIPLY", mean, mean))
        variance = math("MAXIMUM", variance, 0.0)
        ratio = math("DIVIDE", math("ADD", variance, EPSILON), known.variance + EPSILON)
        off = math("MULTIPLY", math("SUBTRACT", tilt, known.mean), math("SQRT", ratio))
        turned = math("SUBTRACT", math("ADD", mean, off), tilt)
        tilt = math("MULTIPLY_ADD", share, turned, tilt)
        tilt = math("MINIMUM", math("MAXIMUM", tilt, -STEEPEST), STEEPEST)
        wide = math("MULTIPLY", alpha, alpha)
        narrow = math("MINIMUM", wide, own * own)
        here = math("MULTIPLY_ADD", math("SUBTRACT", wide, narrow), ratio, narrow)
        here = math("MULTIPLY_ADD", share, math("SUBTRACT", here, wide), wide)
        here = math("MINIMUM", math("MAXIMUM", here, narrow), 1.0)
        return tilt, math("SQRT", here)

    def _weighted(self, weights: Sequence[Any], parts: Sequence[int], by: Any) -> Any:
        """Return the sum of the weights of `parts`, times the sockets `by` if there are any."""
        total: Any = 0.0
        for b in parts:
            if by is None:
                total = self.group.math("ADD", total, weights[b])
            else:
                total = self.group.math("MULTIPLY_ADD", weights[b], by[b], total)
        return total

    def _sum(self, parts: Sequence[int]) -> Any:
        total: Any = 0.0
        for b in parts:
            if self.shares[b] is not None:
                total = self.group.math("ADD", total, self.shares[b])
        return total

    def _tint(self, k: int, color: Any) -> Any:
        """Return the factor on what a set reflects; None if the threads of a set are alike."""
        if color is None:
            return None
        size = self.group.math("MAXIMUM", self.sets[k], THIN)
        ratio = self.group.vector("DIVIDE", color, size)
        part = self.threads.tinted[k]
        return self.group.vector("MULTIPLY_ADD", ratio, (part,) * 3, (1.0 - part,) * 3)


def _four(group: Group, read: tuple[Any, Any]) -> list[Any]:
    """Return the four channels of an image."""
    color, rest = read
    part = group.add("ShaderNodeSeparateColor", Color=color)
    return [*part.outputs[:3], rest]


def _from_0(group: Group, number: Any) -> Any:
    """Return a number of a texture, 0 where it is 0."""
    return group.math("MULTIPLY", number, group.math("GREATER_THAN", number, LEAST_HALF))


def _place(group: Group, threads: Threads) -> Any:
    """Return where to read the textures."""
    uv = group.uv()
    if not threads.matrix:
        return uv
    a, b, c, d, x, y = threads.matrix
    across, up = threads.repeat
    rows = (((a, b, 0.0), x, across), ((c, d, 0.0), y, up))
    # Exact while the UVs are: a fraction of a large number of threads.
    found = [
        group.math("ADD", group.vector("DOT_PRODUCT", uv, tuple(v / n for v in row)), offset / n)
        for row, offset, n in rows
    ]
    return group.joined(found[0], found[1], 0.0)

"""Read what a look says of single threads, `cycles:near:` in its inputs; see docs/lobes_near.md.

This module knows USD and not Blender. The formulas are those of fabricusd.materials.near.mixture.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

PARTS = 8
"""Of the threads, those of the weft first: four for each set."""

TEXTURES = ("lobes_weft", "lobes_warp", "lobes_lean", "lobes_weft_tint", "lobes_warp_tint")
"""The last two are absent if the threads of a set have one colour."""

LUMINANCE = (0.2126, 0.7152, 0.0722)

Rows = tuple[tuple[float, float, float], ...]


@dataclass(frozen=True, kw_only=True)
class Threads:
    """The threads of a look.

    share, angle : of each part; spread, tinted : of each set
    own : width of each lobe at one point of a thread
    factors : three channels for each part, of each lobe, of the diffuse part and of the sheen
    through : of each part; empty if no light comes through
    files : textures by the names in TEXTURES
    matrix : the threads from the UVs, with the offset; empty if the textures lie on the UVs
    repeat : ends and picks of a texture
    density : threads along a UV of 1, the geometric mean of both sets; 0 if it is not known
    """

    share: tuple[float, ...]
    angle: tuple[float, ...]
    spread: tuple[float, ...]
    tinted: tuple[float, ...]
    own: tuple[float, ...]
    factors: tuple[Rows, ...]
    through: Rows
    files: tuple[tuple[str, str], ...]
    matrix: tuple[float, ...]
    repeat: tuple[float, ...]
    density: float = 0.0

    def whole(self, rows: Rows) -> tuple[float, float, float]:
        """Return the sum of rows over the parts of the whole cloth."""
        r, g, b = (
            sum(row[c] * w for row, w in zip(rows, self.share, strict=True)) for c in range(3)
        )
        return r, g, b


@dataclass(frozen=True, kw_only=True)
class Turning:
    """What does not change from texel to texel of a lobe.

    membership : luminance of the lobe on each part; own : the same, 0 for parts across its axis
    mean, variance : of the tangent angle over the whole cloth
    """

    membership: tuple[float, ...]
    own: tuple[float, ...]
    mean: float
    variance: float


def read(
    value: Callable[[str], Any], file: Callable[[str], str | None], count: int
) -> Threads | None:
    """Return the threads of a material; None if it has none, or not those of `count` lobes.

    value : gives an input by its name after `cycles:near:`, () if there is none
    file : gives a texture's file by such a name
    """
    files = tuple((name, path) for name in TEXTURES if (path := file(name)) is not None)
    share, factors, own = value("share"), _rows(value("factors")), value("own")
    whole = len(share) == PARTS and len(own) == count and len(factors) == (count + 2) * PARTS
    if not whole or not {name for name, _ in files} >= set(TEXTURES[:3]):
        return None
    return Threads(
        share=share, angle=value("angle"), spread=value("spread"), tinted=value("tinted"), own=own,
        factors=tuple(factors[k : k + PARTS] for k in range(0, len(factors), PARTS)),
        through=_rows(value("through")), files=files, matrix=value("threads"),
        repeat=value("repeat"), density=float(next(iter(value("density")), 0.0)),
    )  # fmt: skip


def _rows(numbers: Sequence[float]) -> Rows:
    return tuple(
        (numbers[k], numbers[k + 1], numbers[k + 2]) for k in range(0, len(numbers) - 2, 3)
    )


def turning(
    threads: Threads, number: int, color: tuple[float, float, float], along: int
) -> Turning:
    """Return the constants of a lobe.

    number : of the lobe, of which a pair is two; along : 0 for the weft, 1 for the warp
    """
    membership = tuple(
        sum(c * f * y for c, f, y in zip(color, row, LUMINANCE, strict=True))
        for row in threads.factors[number]
    )
    of_set = range(PARTS // 2 * along, PARTS // 2 * (along + 1))
    own = tuple(m if k in of_set else 0.0 for k, m in enumerate(membership))
    within = threads.spread[along] / max(sum(threads.share[k] for k in of_set), 1e-6)
    weights = [m * w for m, w in zip(own, threads.share, strict=True)]
    total = max(sum(weights), 1e-12)
    mean = sum(w * a for w, a in zip(weights, threads.angle, strict=True)) / total
    square = sum(w * (a * a + within) for w, a in zip(weights, threads.angle, strict=True)) / total
    return Turning(membership=membership, own=own, mean=mean, variance=max(square - mean**2, 0.0))

"""A draft: a weave and a weaver's notes beside it, from which a fabric is made.

Every source of weaves (a name, an expression, an image, a WIF file) yields a `Draft`.
`convert.to_fabric` turns a draft into a `Fabric`; `convert.from_fabric` goes back.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from fabricusd.errors import FabricError
from fabricusd.fabric import Weave
from fabricusd.weaves.color import RGB

LIMIT = 16384
"""Most ends, and most picks, of an imported draft, which then has 256 MiB of cells: four times the
largest jacquard in use."""

LARGEST_LENGTH = 1.0
"""Largest spacing or thickness [m]; a larger one comes from a mistaken unit."""

SMALLEST_LENGTH = 1e-6
"""Smallest spacing or thickness above 0 [m]: a tenth of the finest fibre."""


def quoted(text: str, longest: int = 60) -> str:
    """`text` in quotes, for one line of a message: shortened, unprintable characters as `?`."""
    line = "".join(c if c.isprintable() else "?" for c in text[:longest])
    return f"'{line}{'...' if len(text) > longest else ''}'"


class Side(NamedTuple):
    """What a draft says about one set of threads: colours, spacing, thickness (see `Draft`)."""

    label: str
    threads: int
    colors: tuple[int, ...]
    spacing: float | None
    thickness: float | None
    spacings: tuple[float, ...]
    thicknesses: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Draft:
    """A weave, the colours of its threads, and their sizes as far as they are known.

    weave : Weave
    palette : colours, linear Rec. 709; empty if the source has no colours
    warp_colors, weft_colors : (k,) int - indices into `palette`, repeated across the cloth: end `i`
        has the colour `warp_colors[i % k]`. Palette and both sequences are empty together.
    warp_spacing, weft_spacing : float or None - between the middles of neighbouring threads [m]
    warp_thickness, weft_thickness : float or None - visible width of a thread [m]
    warp_spacings, weft_spacings : (ends,) or (picks,) float, or empty - thread by thread [m],
        overriding the spacing of the set. A thread of spacing 0 is hidden in the cloth.
    warp_thicknesses, weft_thicknesses : likewise [m]; 0 if unknown
    color_range : (low, high) int - range of the display codes in the source
    title : str
    author, notes : str - as the source has them
    source : str - where the draft came from; ignored by ==
    warnings : one line about each assumption made while reading; ignored by ==

    Raises FabricError for an index that has no colour and for a length out of range.
    """

    weave: Weave
    palette: tuple[RGB, ...] = ()
    warp_colors: tuple[int, ...] = ()
    weft_colors: tuple[int, ...] = ()
    warp_spacing: float | None = None
    weft_spacing: float | None = None
    warp_thickness: float | None = None
    weft_thickness: float | None = None
    warp_spacings: tuple[float, ...] = ()
    weft_spacings: tuple[float, ...] = ()
    warp_thicknesses: tuple[float, ...] = ()
    weft_thicknesses: tuple[float, ...] = ()
    color_range: tuple[int, int] = (0, 255)
    title: str = ""
    author: str = ""
    notes: str = ""
    source: str = field(default="", compare=False)
    warnings: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        for k, color in enumerate(self.palette):
            if len(color) != 3 or not all(math.isfinite(x) and x >= 0 for x in color):
                raise FabricError(
                    f"palette colour {k}", f"is {color}; it must be 3 numbers of at least 0"
                )
        if not len({bool(self.palette), bool(self.warp_colors), bool(self.weft_colors)}) == 1:
            raise FabricError(
                "colours",
                f"number {len(self.palette)} in the palette, {len(self.warp_colors)} in the warp "
                f"and {len(self.weft_colors)} in the weft; give all three, or none",
            )
        for side in (self.warp, self.weft):
            _check_side(side, len(self.palette))

    @property
    def warp(self) -> Side:
        """The warp's colours and sizes."""
        return Side(
            "warp", self.weave.ends, self.warp_colors, self.warp_spacing, self.warp_thickness,
            self.warp_spacings, self.warp_thicknesses,
        )  # fmt: skip

    @property
    def weft(self) -> Side:
        """The weft's colours and sizes."""
        return Side(
            "weft", self.weave.picks, self.weft_colors, self.weft_spacing, self.weft_thickness,
            self.weft_spacings, self.weft_thicknesses,
        )  # fmt: skip

    @property
    def colored(self) -> bool:
        """Whether the draft gives its threads colours."""
        return bool(self.palette)


def known_length(value: float) -> float | None:
    """`value` [m] if it is in range for a spacing or a thickness, else None."""
    return value if SMALLEST_LENGTH <= value <= LARGEST_LENGTH else None


def _check_side(side: Side, colors: int) -> None:
    for k, index in enumerate(side.colors):
        if not 0 <= index < colors:
            raise FabricError(
                f"{side.label} colour {k}",
                f"is {index}; it must be from 0 to {colors - 1}, since the palette has {colors}",
            )
    for name, value in (("spacing", side.spacing), ("thickness", side.thickness)):
        if value is not None and not SMALLEST_LENGTH <= value <= LARGEST_LENGTH:
            raise FabricError(
                f"{side.label} {name}",
                f"is {value} m; it must be from {SMALLEST_LENGTH:g} to {LARGEST_LENGTH:g} m",
            )
    for name, values in (("spacing", side.spacings), ("thickness", side.thicknesses)):
        if values and len(values) != side.threads:
            raise FabricError(
                f"{side.label} {name}",
                f"has {len(values)} numbers; it must have {side.threads}, one for each thread",
            )
        for k, value in enumerate(values):
            if value != 0 and not SMALLEST_LENGTH <= value <= LARGEST_LENGTH:
                raise FabricError(
                    f"{side.label} {name} {k}",
                    f"is {value} m; it must be 0, or from {SMALLEST_LENGTH:g} to "
                    f"{LARGEST_LENGTH:g} m",
                )


def with_colors(
    draft: Draft, warp: Sequence[RGB] | None = None, weft: Sequence[RGB] | None = None
) -> Draft:
    """`draft` in other colours; `warp` and `weft` are linear colours, repeated across the cloth.

    A set that is given no colours keeps its own. If it has none of its own, it takes those of the
    other set, so that a single colour has to be given only once.
    """
    if not warp and not weft:
        return draft
    own = {side.label: [draft.palette[k] for k in side.colors] for side in (draft.warp, draft.weft)}
    ends = list(warp or own["warp"] or weft or ())
    picks = list(weft or own["weft"] or warp or ())
    palette = tuple(dict.fromkeys([*ends, *picks]))
    return replace(
        draft,
        palette=palette,
        warp_colors=tuple(palette.index(c) for c in ends),
        weft_colors=tuple(palette.index(c) for c in picks),
    )

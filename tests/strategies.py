"""Hypothesis strategies for fabrics, as an artist could author them."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from fabricusd.fabric import DEGREE, MODELS, Fabric, TangentCurve, Thread, ThreadSet, Weave
from fabricusd.sides import LENGTHS, Sides

NAMES = st.from_regex(r"[A-Za-zäßαя麻_][A-Za-z0-9äßαя麻_]{0,10}", fullmatch=True)
TEXT = st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs")), max_size=40)


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


def degrees(low: float, high: float) -> st.SearchStrategy[float]:
    """Angles [rad] that were typed in degrees, with up to four decimals."""
    return st.integers(round(low * 1e4), round(high * 1e4)).map(lambda k: k / 1e4 * DEGREE)


def scaled(low: float, high: float, scale: float) -> st.SearchStrategy[float]:
    """Lengths and densities [SI] that were typed in the file's unit."""
    return st.integers(round(low * 1e4), round(high * 1e4)).map(lambda k: k / 1e4 * scale)


COLORS = st.tuples(numbers(0, 1), numbers(0, 1), numbers(0, 1))


@st.composite
def curves(draw: st.DrawFn) -> TangentCurve:
    lengths = draw(st.lists(st.sampled_from((0.0, 0.5, 0.66, 1.0, 1.33, 2.0)), min_size=1))
    if sum(lengths) == 0:
        lengths = [*lengths, 1.0]
    angles = [draw(degrees(-90, 90)) for _ in range(len(lengths) + 1)]
    return TangentCurve.from_lengths(angles, lengths)


@st.composite
def threads(draw: st.DrawFn, uneven: bool = False) -> Thread:
    return Thread(
        albedo=draw(COLORS),
        ior=draw(numbers(1, 3)),
        isotropic=draw(numbers(0, 1)),
        gamma_surface=draw(degrees(0.1, 90)),
        gamma_volume=draw(degrees(0.1, 120)),
        surface_gain=draw(numbers(0, 2)),
        thickness=draw(scaled(0, 2, 1e-3)),
        linear_density=draw(scaled(0, 500, 1e-6)),
        curve=draw(curves()),
        model=draw(st.sampled_from(("", *MODELS))),
        color=draw(COLORS),
        **(draw(yarns()) if uneven else {}),
        documentation=draw(TEXT),
    )


@st.composite
def yarns(draw: st.DrawFn) -> dict[str, float | int]:
    """Fields of a thread that say how even it is; half of all threads are wires."""
    if draw(st.booleans()):
        return {}
    slub, apart = draw(st.integers(1000, 500000)), draw(st.integers(1, 9))
    return {
        "unevenness_cv": draw(numbers(0, 0.5)),
        "unevenness_length": draw(scaled(0.5, 50, 1e-3)),
        "unevenness_count": draw(numbers(0, 0.3)),
        "unevenness_shade": draw(numbers(0, 0.5)),
        "slub_amount": draw(numbers(0, 2)),
        "slub_length": slub / 1e4 * 1e-3,
        "slub_spacing": slub * apart / 1e4 * 1e-3,
        "plies": draw(st.integers(1, 4)),
        "twist": draw(numbers(-2000, 2000)),
        "hairiness": draw(numbers(0, 12)),
    }


@st.composite
def weaves(draw: st.DrawFn, largest: int = 12) -> Weave:
    m, n = draw(st.integers(1, largest)), draw(st.integers(1, largest))
    bits = draw(st.lists(st.booleans(), min_size=m * n, max_size=m * n))
    return Weave(np.array(bits).reshape(m, n), draw(TEXT))


@st.composite
def thread_sets(draw: st.DrawFn, count: int, coverage: float | None) -> ThreadSet:
    sequence = draw(st.lists(st.integers(0, count - 1), min_size=1, max_size=9))
    return ThreadSet(
        sequence=tuple(sequence), density=draw(scaled(0.5, 200, 100.0)), coverage=coverage
    )


SHARES = st.sampled_from(LENGTHS).flatmap(
    lambda count: st.lists(numbers(0, 0.5), min_size=count, max_size=count).map(tuple)
)
SIDES = st.just(Sides()) | st.builds(
    Sides, gap=SHARES, surface=SHARES, reflected=SHARES, transmitted=SHARES, forward=SHARES
)


@st.composite
def fabrics(draw: st.DrawFn, back: bool = True, uneven: bool = False) -> Fabric:
    """uneven : whether threads may be, so that no repeat of the cloth looks like another."""
    names = draw(st.lists(NAMES, min_size=1, max_size=4, unique=True))
    share = draw(numbers(0, 1))
    coverages = draw(st.sampled_from(((None, None), (share, None), (share, 1 - share))))
    return Fabric(
        name=draw(NAMES),
        threads={name: draw(threads(uneven)) for name in names},
        weave=draw(weaves()),
        warp=draw(thread_sets(len(names), coverages[0])),
        weft=draw(thread_sets(len(names), coverages[1])),
        model=draw(st.sampled_from(MODELS)),
        opaque=draw(st.booleans()),
        sides=draw(SIDES),
        masking_width=draw(degrees(1, 90)),
        unevenness_seed=draw(st.integers(0, 2**31 - 1)),
        back=draw(st.none() | fabrics(False, uneven)) if back else None,
        documentation=draw(TEXT),
    )

"""A mixture as the numbers that a solver changes, and the derivatives of its value by them.

The factor V of a mixture stays as it is.

A lobe has, in turn: its tilt, the logarithms of both widths and of the three channels of its
colour, the powers p, r and s, and in the form of MaterialX the logarithms of its rise and of the
exponent e. The mixture ends with the logarithms of its diffuse colour, the
power q, the logarithms of the colour of its sheen, the roughness of its sheen, and its power u.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.materials.fit.models import sheen_value
from fabricusd.materials.lobes.mixture import (
    EVEN,
    MATERIALX,
    UPRIGHT,
    Lobe,
    Mixture,
    Reflected,
    reflected,
    view_factor,
    weight,
)

Floats = NDArray[np.float64]

TAIL = 9

_STEP = 1e-5
"""Of differences, where a derivative has no closed form."""

NAMES = (
    "tilt", "alpha_along", "alpha_across", "red", "green", "blue", "facing", "crossing", "upright",
    "rise", "rise_power",
)  # fmt: skip
TAIL_NAMES = (
    "diffuse red", "diffuse green", "diffuse blue", "diffuse_power",
    "sheen red", "sheen green", "sheen blue", "sheen_roughness", "sheen_power",
)  # fmt: skip

_LOG = math.log
DARK = 1e-5
"""Least of a colour: as good as none."""

ABSENT = 1e-3
"""Largest channel of a part that does not show, and whose other numbers do not matter."""

LEVEL = 0.05
"""Largest logarithm of a rise whose exponent does not matter."""

LOBE_BOUNDS = (
    (-1.5, 1.5), (_LOG(0.015), 0.0), (_LOG(0.015), 0.0),
    *((_LOG(DARK), _LOG(30.0)),) * 3,
    (-1.0, 4.0), (-3.0, 3.0), (-2.0, 2.0),
    (_LOG(1.0 / 30.0), _LOG(300.0)), (_LOG(0.5), _LOG(6.0)),
)  # fmt: skip
TAIL_BOUNDS = (
    *((_LOG(DARK), _LOG(2.0)),) * 3, (-0.5, 2.0), *((_LOG(DARK), _LOG(30.0)),) * 3, (0.07, 1.0),
    (-1.0, 3.0),
)  # fmt: skip


def per_lobe(form: str) -> int:
    """How many numbers a lobe has."""
    return len(NAMES) if form == MATERIALX else len(NAMES) - 2


def pack(mixture: Mixture) -> Floats:
    """Return the numbers of a mixture."""
    found: list[float] = []
    for one in mixture.lobes:
        found += [one.tilt, _LOG(one.alpha_along), _LOG(one.alpha_across), *_logs(one.color)]
        found += [one.facing, one.crossing, one.upright]
        if mixture.form == MATERIALX:
            found += [_LOG(one.rise), _LOG(one.rise_power)]
    found += [*_logs(mixture.diffuse), mixture.diffuse_power]
    found += [*_logs(mixture.sheen), mixture.sheen_roughness, mixture.sheen_power]
    return np.array(found)


def unpack(x: Floats, like: Mixture) -> Mixture:
    """Return the mixture of the numbers x; what they do not say is that of `like`."""
    lobes, count = [], per_lobe(like.form)
    for k, one in enumerate(like.lobes):
        v = [float(t) for t in x[k * count : (k + 1) * count]]
        rises = [math.exp(t) for t in v[9:]] or [one.rise, one.rise_power]
        lobes.append(
            replace(
                one, tilt=v[0] if one.tilt else 0.0,
                alpha_along=math.exp(v[1]), alpha_across=math.exp(v[2]),
                color=(math.exp(v[3]), math.exp(v[4]), math.exp(v[5])),
                facing=v[6], crossing=v[7], upright=v[8], rise=rises[0], rise_power=rises[1],
            )
        )  # fmt: skip
    v = [float(t) for t in x[len(lobes) * count :]]
    return replace(
        like, lobes=tuple(lobes),
        diffuse=(math.exp(v[0]), math.exp(v[1]), math.exp(v[2])), diffuse_power=v[3],
        sheen=(math.exp(v[4]), math.exp(v[5]), math.exp(v[6])), sheen_roughness=v[7],
        sheen_power=v[8],
    )  # fmt: skip


def bounds(mixture: Mixture) -> tuple[Floats, Floats]:
    """Return the least and the greatest of each number; a lobe that stands upright stays so."""
    low, high = [], []
    for one in mixture.lobes:
        at = 1e-9 if one.tilt == 0.0 else None
        first = (0.0, 1.5) if one.paired else LOBE_BOUNDS[0]
        mine = LOBE_BOUNDS[1 : per_lobe(mixture.form)]
        for least, most in ((-at, at) if at else first, *mine):
            low.append(least)
            high.append(most)
    low += [least for least, _ in TAIL_BOUNDS]
    high += [most for _, most in TAIL_BOUNDS]
    return np.array(low), np.array(high)


def _logs(color: Sequence[float]) -> list[float]:
    return [_LOG(max(c, DARK)) for c in color]


def at_bounds(mixture: Mixture) -> list[str]:
    """Name the numbers of a mixture that are at a bound, where the bound is not simply none."""
    low, high = bounds(mixture)
    x, names = pack(mixture), []
    # Neither the roughness nor the power of what is not there matters, and a level tilt is fixed.
    fixed, count = high - low < 1e-6, per_lobe(mixture.form)
    for k, one in enumerate(mixture.lobes):
        names += [f"{name} of lobe {k}" for name in NAMES[:count]]
        if mixture.form == MATERIALX:
            fixed[(k + 1) * count - 1] = abs(_LOG(one.rise)) < LEVEL
    names += TAIL_NAMES
    fixed[-2:] = max(mixture.sheen) <= ABSENT
    fixed[-6] = max(mixture.diffuse) <= ABSENT
    at_low, at_high = (x < low + 1e-6) & (low != _LOG(DARK)), x > high - 1e-6
    return [
        f"{name} is at its {'least' if least else 'greatest'}"
        for name, least, most, held in zip(names, at_low, at_high, fixed, strict=True)
        if (least or most) and not held
    ]


def value_and_slopes(
    mixture: Mixture, wi: Floats, wo: Floats, *, slopes: bool = True
) -> tuple[Floats, Floats]:
    """(n, 3) value of a mixture for directions above the cloth, and its derivatives (m, n, 3)."""
    count = per_lobe(mixture.form)
    m = len(mixture.lobes) * count + TAIL
    d = np.zeros((m if slopes else 0, len(wi), 3))
    even = np.maximum(wo[:, 2], EVEN)
    seen = view_factor(mixture, wo)
    diffuse = (seen * even**mixture.diffuse_power * wi[:, 2] / np.pi)[:, None] * np.array(
        mixture.diffuse
    )
    upright = np.maximum(wo[:, 2], UPRIGHT)
    fuzz = seen * upright**mixture.sheen_power
    unit = fuzz * sheen_value(mixture.sheen_roughness, wi, wo)
    sheen = unit[:, None] * np.array(mixture.sheen)
    out = diffuse + sheen
    if slopes:
        tail = d[-TAIL:]
        for c in range(3):
            tail[c, :, c], tail[4 + c, :, c] = diffuse[:, c], sheen[:, c]
        tail[3] = diffuse * np.log(even)[:, None]
        moved = fuzz * sheen_value(mixture.sheen_roughness - _STEP, wi, wo)
        tail[7] = ((unit - moved) / _STEP)[:, None] * np.array(mixture.sheen)
        tail[8] = sheen * np.log(upright)[:, None]
    for k, lobe in enumerate(mixture.lobes):
        mine = d[k * count : (k + 1) * count]
        for sign, tilt in zip((1.0, -1.0), lobe.tilts, strict=False):
            out += _add_lobe(mixture.form, lobe, sign, tilt, wi, wo, seen, mine if slopes else None)
    return out, d


def _add_lobe(
    form: str, lobe: Lobe, sign: float, tilt: float, wi: Floats, wo: Floats, seen: Floats,
    d: Floats | None,
) -> Floats:  # fmt: skip
    """(n, 3) value of one lobe, `seen` being V; its derivatives are added to d (m, n, 3)."""

    def lobed(psi: float, ax: float, ay: float) -> tuple[Reflected, Floats]:
        one = reflected(form, lobe, psi, (ax, ay), wi, wo)
        f = (seen * weight(lobe, one, wo))[:, None] * np.array(lobe.color)
        return one, f

    def value(one: Reflected, f: Floats) -> Floats:
        return np.asarray(one.value[:, None] * f * (1.0 + f * one.spared[:, None]))

    ax, ay = lobe.alpha_along, lobe.alpha_across
    one, f = lobed(tilt, ax, ay)
    got = value(one, f)
    if d is None:
        return got
    grown = math.exp(-_STEP)
    moves = ((tilt - _STEP, ax, ay), (tilt, ax * grown, ay), (tilt, ax, ay * grown))
    for j, moved in enumerate(moves):
        d[j] += (sign if j == 0 else 1.0) * (got - value(*lobed(*moved))) / _STEP
    by_log = one.value[:, None] * f * (1.0 + 2.0 * f * one.spared[:, None])
    for c in range(3):
        d[3 + c, :, c] += by_log[:, c]
    bases = (one.facing, one.crossing, np.maximum(wo[:, 2], UPRIGHT))
    for j, base in enumerate(bases, 6):
        d[j] += by_log * np.log(base)[:, None]
    if form == MATERIALX:
        raised = one.parted**lobe.rise_power
        factor = 1.0 + (lobe.rise - 1.0) * raised
        log = lobe.rise_power * np.log(np.maximum(one.parted, 1e-12))
        for j, slope in enumerate((lobe.rise * raised, (lobe.rise - 1.0) * raised * log), 9):
            d[j] += by_log * (slope / factor)[:, None]
    return got

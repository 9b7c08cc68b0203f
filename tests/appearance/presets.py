"""The published fabrics ([Sadeghi2013] Table II, MODEL section 11) as values, for the tests.

Thread numbers, coverages and curves are the published ones. Grids, densities and thicknesses are
not published: they are chosen here so that both sets show.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fabricusd.fabric import DEGREE, Fabric, TangentCurve, Thread, ThreadSet, Weave

PLAIN = Weave(np.eye(2, dtype=bool), "plain")


def regular_weave(size: int, over: int, step: int, name: str) -> Weave:
    """`size` by `size` cells; warp on top where `(j - step i) mod size < over`."""
    i, j = np.indices((size, size))
    return Weave((j - step * i) % size < over, name)


SATIN_5 = regular_weave(5, 4, 2, "satin 5 step 2, warp-faced")
TWILL_2_1 = regular_weave(3, 2, 1, "twill 2/1")


def thread(
    color: tuple[float, float, float],
    scale: float,
    ior: float,
    isotropic: float,
    gamma_surface: float,
    gamma_volume: float,
    offsets: Iterable[float],
    lengths: Iterable[float],
    thickness: float = 0.2e-3,
) -> Thread:
    """One row of the table: `A` is color times scale, angles in degrees, thickness in metres."""
    return Thread(
        albedo=(color[0] * scale, color[1] * scale, color[2] * scale),
        ior=ior,
        isotropic=isotropic,
        gamma_surface=gamma_surface * DEGREE,
        gamma_volume=gamma_volume * DEGREE,
        thickness=thickness,
        curve=TangentCurve.from_lengths((a * DEGREE for a in offsets), lengths),
        color=color,
    )


def _fabric(
    name: str,
    warp: Thread,
    weft: Thread,
    coverage: tuple[float, float],
    weave: Weave,
    per_cm: tuple[float, float],
    opaque: bool = False,
) -> Fabric:
    return Fabric(
        name=name,
        threads={"Warp": warp, "Weft": weft},
        weave=weave,
        warp=ThreadSet(sequence=(0,), density=per_cm[0] * 100, coverage=coverage[0]),
        weft=ThreadSet(sequence=(1,), density=per_cm[1] * 100, coverage=coverage[1]),
        opaque=opaque,
    )


_LINEN = thread((0.2, 0.8, 1.0), 0.3, 1.46, 0.3, 12, 24, (-25, 25), (1,), 0.4e-3)
_CREPE = (1.0, 0.95, 0.05)
_SATIN = (1.0, 0.37, 0.3)
_SATIN_TWISTED = thread(_SATIN, 0.2, 1.539, 0.7, 30, 60, (0, 0), (1,), 0.1e-3)
_PILE = (0.05, 0.02, 0.0)

PRESETS: dict[str, Fabric] = {
    fabric.name: fabric
    for fabric in (
        _fabric("linen_plain", _LINEN, _LINEN, (0.33, 0.33), PLAIN, (15, 15)),
        _fabric(
            "silk_crepe_de_chine",
            thread(_CREPE, 0.16, 1.345, 0.3, 18, 32, (0, 0), (1,), 0.1e-3),
            thread(_CREPE, 0.12, 1.345, 0.2, 5, 10, (-35, -35, 35, 35), (1, 1, 1)),
            (0.25, 0.75),
            PLAIN,
            (60, 40),
        ),
        _fabric(
            "polyester_satin_charmeuse",
            thread(
                _SATIN,
                0.035,
                1.539,
                0.1,
                2.5,
                5,
                (-32, -32, -18, 0, 0, 18, 32, 32),
                (1.33, 0.66, 2, 2, 2, 0.66, 1.33),
                0.1e-3,
            ),
            _SATIN_TWISTED,
            (0.90, 0.10),
            SATIN_5,
            (100, 40),
        ),
        _fabric(
            "polyester_satin_charmeuse_back",
            thread(
                _SATIN,
                0.035,
                1.539,
                0.1,
                2.5,
                5,
                (-30, -30, 30, 30, -5, -5, 5, 5),
                (1.33, 1.33, 1.33, 0, 0.67, 0.67, 0.67),
                0.1e-3,
            ),
            _SATIN_TWISTED,
            (0.67, 0.33),
            TWILL_2_1,
            (100, 40),
        ),
        _fabric(
            "silk_shot",
            thread((1.0, 0.0, 0.1), 0.6, 1.345, 0.1, 5, 10, (0, 0), (1,), 0.1e-3),
            thread((0.1, 1.0, 0.4), 0.2, 1.345, 0.1, 4, 8, (-25, -25, 25, 25), (1.33, 2.67, 1.33)),
            (0.14, 0.86),
            PLAIN,
            (50, 50),
        ),
        _fabric(
            "velvet",
            thread(_PILE, 0.3, 1.46, 0.1, 6, 12, (-90, -55, 55, 90), (0.5, 0, 0.5)),
            thread(_PILE, 0.3, 1.46, 0.1, 6, 12, (-90, -50), (1,)),
            (0.5, 0.5),
            PLAIN,
            (40, 40),
            opaque=True,
        ),
    )
}


def with_model(fabric: Fabric, model: str) -> Fabric:
    """`fabric` with every thread evaluated by `model`."""
    return replace(
        fabric,
        model=model,
        threads={k: replace(t, model="") for k, t in fabric.threads.items()},
    )


EVERY_RUN = ("linen_plain", "polyester_satin_charmeuse", "velvet")
"""Presets that `make test` looks at where all of them would take long: a plain weave with gaps, a
satin without any, pile."""


LINEN = ("linen_plain",)
"""The preset that `make test` looks at where even three take long."""


def often(rows: Iterable[Any], keep: Sequence[Any] = EVERY_RUN) -> list[Any]:
    """Parameters for `parametrize`: those that are not in `keep` are `exhaustive`.

    rows : names of presets or of anything else, or tuples that begin with one
    """
    found = []
    for row in rows:
        values = row if isinstance(row, tuple) else (row,)
        marks = () if values[0] in keep else pytest.mark.exhaustive
        found.append(pytest.param(*values, marks=marks))
    return found

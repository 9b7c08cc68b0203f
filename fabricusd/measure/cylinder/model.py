"""What a cloth whose weave is known reflects, split into its surface and what each thread's A adds.

The quadrature over the curves is one of fixed nodes: rules that follow the width of a lobe make the
light jump when a search changes that width.
"""

from __future__ import annotations


from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.laws import law_of
from fabricusd.appearance.published.tables import has_cell_lobes, surface_tables
from fabricusd.appearance.shadow.methods import Shadow, compile_shadow
from fabricusd.appearance.surface import far_all
from fabricusd.appearance.weave.quadrature import CELLS, POINTS, Rule
from fabricusd.errors import FabricError
from fabricusd.fabric import CONSERVING_MODEL, Fabric, TangentCurve, even
from fabricusd.measure.angles import DEGREE

Floats = NDArray[np.float64]

SPACING = 2.5 * DEGREE
PROBE = 1e-3
"""Albedo of the probes: too dark for the law that divides by what is brighter than white."""
STEEPEST = 1.45
"""Largest tangent angle of a curve that is scaled [rad]."""


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number of the search. field : of the thread, "curve" or "coverage"; which : index of the
    thread, or of the set for coverage"""

    label: str
    field: str
    which: int
    low: float
    high: float
    start: tuple[float, float]
    step: float
    scale: float = 1.0
    unit: str = ""


FIELDS = (
    ("ior", "eta", 1.2, 1.8, (1.3, 1.65), 0.1, 1.0, ""),
    ("isotropic", "kd", 0.0, 1.0, (0.05, 0.7), 0.2, 1.0, ""),
    ("gamma_surface", "gs", 1 * DEGREE, 40 * DEGREE, (2 * DEGREE, 25 * DEGREE), 0.1, DEGREE,
     "degrees"),
    ("gamma_volume", "gv", 1.5 * DEGREE, 80 * DEGREE, (4 * DEGREE, 50 * DEGREE), 0.2, DEGREE,
     "degrees"),
)  # fmt: skip


def worn(fabric: Fabric) -> list[int]:
    """Indices of the threads that the cloth has on its face."""
    return sorted({*fabric.warp.sequence, *fabric.weft.sequence})


def numbers(fabric: Fabric, *, coverage: bool) -> tuple[Number, ...]:
    """What a fit of `fabric` varies."""
    found = []
    names = list(fabric.threads)
    for k in worn(fabric):
        for field, label, low, high, start, step, scale, unit in FIELDS:
            found.append(
                Number(label=f"{names[k]} {label}", field=field, which=k, low=low, high=high,
                       start=start, step=step, scale=scale, unit=unit)
            )  # fmt: skip
        if not fabric.thread_list[k].curve.is_straight:
            found.append(
                Number(label=f"{names[k]} curve scale", field="curve", which=k, low=0.4, high=1.8,
                       start=(0.7, 1.3), step=0.2)
            )  # fmt: skip
    if coverage:
        for j, name in enumerate(("warp", "weft")):
            found.append(
                Number(label=f"{name} coverage", field="coverage", which=j, low=0.02, high=1.0,
                       start=(0.2, 0.5), step=0.2)
            )  # fmt: skip
    return tuple(found)


def fabric_of(
    template: Fabric, names: Sequence[Number], x: Floats, albedo: dict[int, tuple[float, ...]]
) -> Fabric:
    """The template with the numbers x, and albedos by thread."""
    threads = list(template.thread_list)
    covered: dict[int, float] = {}
    for number, value in zip(names, x, strict=True):
        k, v = number.which, float(value)
        if number.field == "coverage":
            covered[k] = v
        elif number.field == "curve":
            curve = threads[k].curve
            angles = tuple(float(np.clip(a * v, -STEEPEST, STEEPEST)) for a in curve.angles)
            threads[k] = replace(
                threads[k], curve=TangentCurve(positions=curve.positions, angles=angles)
            )
        else:
            changed: dict[str, Any] = {number.field: v}
            threads[k] = replace(threads[k], **changed)
    for k, a in albedo.items():
        threads[k] = replace(threads[k], albedo=(a[0], a[1], a[2]))
    made = replace(template, threads=dict(zip(template.threads, threads, strict=True)))
    if covered:
        total = max(sum(covered.values()), 1.0)
        made = replace(
            made, warp=replace(made.warp, coverage=covered[0] / total),
            weft=replace(made.weft, coverage=covered[1] / total),
        )  # fmt: skip
    return made


def require_template(fabric: Fabric, source: str) -> Fabric:
    """`fabric` as it is fitted, even and without a back; FabricError for a model that is not."""
    for name, thread in fabric.threads.items():
        if fabric.model_of(thread) == CONSERVING_MODEL:
            raise FabricError(
                f"'{source}'",
                f"has the thread '{name}' of the model {CONSERVING_MODEL}; cylinders are fitted "
                "with thesis or microcylinder threads",
            )
    return even(replace(fabric, back=None))


class Model:
    """Columns of a template for pairs of directions. wi, wo : (n, 3) in the cloth's frame"""

    def __init__(self, template: Fabric, wi: Floats, wo: Floats) -> None:
        self.template = template
        self.wi, self.wo = (np.ascontiguousarray(w.T) for w in (wi, wo))
        form = CELLS if has_cell_lobes(template) else POINTS
        self.rule = Rule(form, SPACING if form == CELLS else 0.5)
        self.shadowed = law_of(template).absolute
        self._shadow: tuple[Any, Shadow] | None = None

    def _shadow_of(self, fabric: Fabric) -> Shadow | None:
        """The shadow of a cloth, which its curves and coverage make."""
        if not self.shadowed:
            return None
        key = tuple(t.curve for t in fabric.thread_list), fabric.warp.coverage, fabric.weft.coverage
        if self._shadow is None or self._shadow[0] != key:
            self._shadow = key, compile_shadow(fabric, "horizon", precision=np.float64)
        return self._shadow[1]

    def columns(self, names: Sequence[Number], x: Floats) -> tuple[Floats, Floats]:
        """((n,) surface, (n, k) volume per unit of A of the k threads that are worn)."""
        which = worn(self.template)
        surface = np.zeros(self.wi.shape[1])
        volume = np.zeros((self.wi.shape[1], len(which)))
        # Three channels tell the surface and two threads at a time.
        for first in range(0, len(which), 2):
            two = which[first : first + 2]
            albedo: dict[int, tuple[float, ...]] = {k: (0.0, 0.0, 0.0) for k in which}
            albedo |= {k: (0.0, *(PROBE * (k == j) for j in (two[0], two[-1]))) for k in two}
            fabric = fabric_of(self.template, names, x, albedo)
            out = self._far(fabric)
            surface = out[0]
            for n in range(len(two)):
                volume[:, first + n] = (out[1 + n] - out[0]) / PROBE
        return surface, volume

    def _far(self, fabric: Fabric) -> Floats:
        tables = surface_tables(
            fabric, precision=np.float64, rule=self.rule, shadow=self._shadow_of(fabric)
        )
        out = np.zeros_like(self.wi)
        real: Any = np.float64
        far_all(real, tables, self.wi, self.wo, out)
        return out



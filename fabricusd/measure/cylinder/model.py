"""What a cloth whose weave is known reflects, split into its surface and what each thread's A adds.

The quadrature over the curves is one of fixed nodes: rules that follow the width of a lobe make the
light jump when a search changes that width.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.laws import law_of
from fabricusd.appearance.published.tables import has_cell_lobes
from fabricusd.appearance.scattering.columns import LAW
from fabricusd.appearance.scattering.model import PUBLISHED
from fabricusd.appearance.scattering.table import pack_threads
from fabricusd.appearance.shadow.kinds import Shadow
from fabricusd.appearance.shadow.mean import node_groups
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.surface import far_all
from fabricusd.appearance.weave.coverage import coverage as cover
from fabricusd.appearance.weave.quadrature import CELLS, POINTS, Rule, curve_nodes
from fabricusd.errors import FabricError
from fabricusd.fabric import CONSERVING_MODEL, Fabric, TangentCurve, even
from fabricusd.measure.angles import DEGREE

Floats = NDArray[np.float64]
Made = TypeVar("Made")

SPACING = 2.5 * DEGREE
PROBE = 1e-3
"""Albedo of the probes: too dark for the law that divides by what is brighter than white."""
KEPT = 8
"""Shadows that are kept: those of a point and of the steps of a derivative."""
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


def _shape(fabric: Fabric) -> Any:
    """What shadows and a law's own tables depend on."""
    curves = tuple(t.curve for t in fabric.thread_list)
    return curves, fabric.warp.coverage, fabric.weft.coverage


def _kept(kept: dict[Any, Made], key: Any, make: Callable[[], Made]) -> Made:
    """The value of `key`, made if it is not kept; the oldest of more than KEPT goes."""
    if key not in kept:
        if len(kept) >= KEPT:
            kept.pop(next(iter(kept)))
        kept[key] = make()
    return kept[key]


class Model:
    """Columns of a template for pairs of directions. wi, wo : (n, 3) in the cloth's frame"""

    def __init__(self, template: Fabric, wi: Floats, wo: Floats) -> None:
        self.template = template
        self.wi, self.wo = (np.ascontiguousarray(w.T) for w in (wi, wo))
        form = CELLS if has_cell_lobes(template) else POINTS
        self.rule = Rule(form, SPACING if form == CELLS else 0.5)
        self.law = law_of(template)
        self.held: Shadow | None = None
        self._shadows: dict[Any, Shadow] = {}
        self._shapes: dict[Any, dict[str, Any]] = {}

    def hold(self, fabric: Fabric | None) -> None:
        """Keep the shadow of one cloth for all others, whose curves differ little; None: of each
        its own, which takes a third of a second."""
        self.held = None if fabric is None else self._shadow_of(fabric)

    def _shadow_of(self, fabric: Fabric) -> Shadow | None:
        """The shadow of a cloth, which its curves and coverage make; None under a law that masks
        instead."""
        if not self.law.absolute:
            return None
        if self.held is not None:
            return self.held
        return _kept(
            self._shadows, _shape(fabric),
            lambda: compile_shadow(fabric, "horizon", precision=np.float64),
        )  # fmt: skip

    def columns(self, names: Sequence[Number], x: Floats) -> tuple[Floats, Floats]:
        """((n,) surface, (n, k) volume per unit of A of the k threads that are worn)."""
        which = worn(self.template)
        surface = np.zeros(self.wi.shape[1])
        volume = np.zeros((self.wi.shape[1], len(which)))
        # Three channels tell the surface and two threads at a time.
        for first in range(0, len(which), 2):
            two = which[first : first + 2]
            albedo: dict[int, tuple[float, ...]] = dict.fromkeys(which, (0.0, 0.0, 0.0))
            albedo |= {k: (0.0, *(PROBE * (k == j) for j in (two[0], two[-1]))) for k in two}
            fabric = fabric_of(self.template, names, x, albedo)
            out = self._far(fabric)
            surface = out[0]
            for n in range(len(two)):
                volume[:, first + n] = (out[1 + n] - out[0]) / PROBE
        return surface, volume

    def _far(self, fabric: Fabric) -> Floats:
        """(3, n) of the law at level `far`, but for what keeps it from being brighter than white:
        that takes seconds, and begins at views that are left out."""
        precision = np.float64
        q = curve_nodes(fabric, self.rule)
        threads = pack_threads(fabric, precision)

        def shape() -> dict[str, Any]:
            shadow = self._shadow_of(fabric)
            groups = None if shadow is None else node_groups(shadow, q, fabric)
            held = None if shadow is None or groups is None else (groups, float(shadow.softness))
            return dict(self.law.make(fabric, held, precision))

        # What a law makes of the shape does not depend on the threads' lobes, if its nodes do not.
        key = _shape(fabric), id(self.held), self.rule, q.psi0.tobytes()
        made = _kept(self._shapes, key, shape)
        nodes = np.stack((np.cos(q.psi0), np.sin(q.psi0), q.weight, q.half), axis=1)
        tables = self.law.tables(
            threads=threads, nodes=np.ascontiguousarray(nodes), node_thread=q.thread,
            published=(threads[q.thread, LAW] == PUBLISHED).astype(np.uint8),
            warp_start=q.warp_start, gap=precision(cover(fabric).gap),
            **made,
        )  # fmt: skip
        out = np.zeros_like(self.wi)
        real: Any = precision
        far_all(real, tables, self.wi, self.wo, out)
        return out

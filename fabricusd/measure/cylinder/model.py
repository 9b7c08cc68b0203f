"""What a cloth whose weave is known reflects, split into its surface and what each thread's A adds.

The quadrature over the curves is one of fixed nodes: rules that follow the width of a lobe make the
light jump when a search changes that width.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import product
from threading import Lock
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.laws import law_of
from fabricusd.appearance.published.tables import has_cell_lobes
from fabricusd.appearance.scattering.columns import LAW
from fabricusd.appearance.scattering.model import PUBLISHED
from fabricusd.appearance.scattering.table import pack_threads
from fabricusd.appearance.shadow.mean import node_means
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.surface import far_all
from fabricusd.appearance.weave.coverage import coverage as cover
from fabricusd.appearance.weave.quadrature import CELLS, POINTS, CurveNodes, Rule, curve_nodes
from fabricusd.errors import FabricError
from fabricusd.fabric import CONSERVING_MODEL, Fabric, TangentCurve, even
from fabricusd.measure.angles import DEGREE

Floats = NDArray[np.float64]
Made = TypeVar("Made")

SPACING = 1.25 * DEGREE
PROBE = 1e-3
"""Albedo of the probes: too dark for the law that divides by what is brighter than white."""
WIDTH = 4 * DEGREE
"""Width of the surface lobes by which curves are cut, whatever the threads' own is."""
KEPT, KEPT_SHADOWS = 8, 96
"""Tables that are kept: those of a point and of the steps of a derivative; and shadows."""
SHAPES = ("curve", "coverage")
GRID = {"curve": 0.1, "coverage": 0.05}
"""Distance of the scales and coverages of which shadows are made; those between are blended."""
STEEPEST = 1.45
"""Largest tangent angle of a curve that is scaled, and up to which it is [rad]."""


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
        if 0.0 < fabric.thread_list[k].curve.steepest < STEEPEST:
            high = min(1.8, STEEPEST / fabric.thread_list[k].curve.steepest)
            found.append(
                Number(label=f"{names[k]} curve scale", field="curve", which=k, low=0.4, high=high,
                       start=(0.7, min(1.3, high)), step=0.2)
            )  # fmt: skip
    if coverage:
        for j, name in enumerate(("warp", "weft")):
            found.append(
                Number(label=f"{name} coverage", field="coverage", which=j, low=0.05, high=1.0,
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
            angles = tuple(a * v for a in curve.angles)
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
    """What a law's own tables depend on."""
    curves = tuple(t.curve for t in fabric.thread_list)
    return curves, fabric.warp.coverage, fabric.weft.coverage


class Kept(Generic[Made]):
    """At most so many values by their keys, the oldest going first; workers share them."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._values: dict[Any, Made] = {}
        self._lock = Lock()

    def __reduce__(self) -> tuple[Any, ...]:
        """On its way to another process it is empty."""
        return Kept, (self.most,)

    def get(self, key: Any, make: Callable[[], Made]) -> Made:
        """The value of `key`, made if it is not kept."""
        with self._lock:
            if key in self._values:
                return self._values[key]
        made = make()
        with self._lock:
            if len(self._values) >= self.most:
                self._values.pop(next(iter(self._values)))
            self._values[key] = made
        return made


def _shares(t: float, *, smooth: bool) -> list[tuple[int, float]]:
    """(step, share) of the points of a grid that make the value at t in [0, 1): by the cubic
    convolution of [Keys1981], whose derivative has no jumps, or by the two points beside it."""
    if not smooth:
        return [(0, 1.0 - t), (1, t)]
    near = [(0, t), (1, 1.0 - t)]
    far = [(-1, 1.0 + t), (2, 2.0 - t)]
    return [(k, (1.5 * d - 2.5) * d * d + 1.0) for k, d in near] + [
        (k, ((-0.5 * d + 2.5) * d - 4.0) * d + 2.0) for k, d in far
    ]


class Model:
    """Columns of a template.

    Nodes keep their number and weights while curves are scaled, and the shadow is blended between
    those of cloths whose scales and coverages lie on a grid, so that the light has no jumps.
    """

    def __init__(self, template: Fabric) -> None:
        self.template = template
        cells = has_cell_lobes(template)
        self.rule = Rule(CELLS, SPACING) if cells else Rule(POINTS, SPACING / WIDTH)
        self.law = law_of(template)
        self.held = False
        self._means: Kept[NDArray[np.float32]] = Kept(KEPT_SHADOWS)
        self._shapes: Kept[dict[str, Any]] = Kept(KEPT)

    def holding(self) -> Model:
        """The same model in which the template's shadow serves all cloths, whose curves differ
        little: one of its own takes a third of a second."""
        made = copy(self)
        made.held = True
        return made

    def columns(
        self, names: Sequence[Number], x: Floats, wi: Floats, wo: Floats
    ) -> tuple[Floats, Floats]:
        """((n,) surface, (n, k) volume per unit of A of the k threads that are worn).

        wi, wo : (n, 3) to light and camera, in the cloth's frame
        """
        which = worn(self.template)
        surface, volume = np.zeros(len(wi)), np.zeros((len(wi), len(which)))
        i, o = (np.ascontiguousarray(w.T) for w in (wi, wo))
        out = np.zeros_like(i)
        real: Any = np.float64
        # Three channels tell the surface and two threads at a time.
        for first in range(0, len(which), 2):
            two = which[first : first + 2]
            albedo: dict[int, tuple[float, ...]] = dict.fromkeys(which, (0.0, 0.0, 0.0))
            albedo |= {k: (0.0, *(PROBE * (k == j) for j in (two[0], two[-1]))) for k in two}
            far_all(real, self._tables(names, x, albedo), i, o, out)
            surface = out[0].copy()
            for n in range(len(two)):
                volume[:, first + n] = (out[1 + n] - out[0]) / PROBE
        return surface, volume

    def _tables(
        self, names: Sequence[Number], x: Floats, albedo: dict[int, tuple[float, ...]]
    ) -> Any:
        """The tables of the law at level `far`, but for what keeps cloth from being brighter than
        white: that takes seconds, and begins at views that are left out."""
        precision = np.float64
        fabric = fabric_of(self.template, names, x, albedo)
        q = self._nodes(names, x)
        threads = pack_threads(fabric, precision)

        def shape() -> dict[str, Any]:
            return dict(self.law.make(fabric, q, self._light(names, x), precision))

        # What a law makes of the shape does not depend on the threads' lobes.
        made = self._shapes.get((_shape(fabric), self.held), shape)
        nodes = np.stack((np.cos(q.psi0), np.sin(q.psi0), q.weight, q.half), axis=1)
        return self.law.tables(
            threads=threads, nodes=np.ascontiguousarray(nodes), node_thread=q.thread,
            published=(threads[q.thread, LAW] == PUBLISHED).astype(np.uint8),
            warp_start=q.warp_start, gap=precision(cover(fabric).gap),
            **made,
        )  # fmt: skip

    def _nodes(self, names: Sequence[Number], x: Floats) -> CurveNodes:
        """The template's nodes with the weights of x, their angles scaled as the curves are."""
        shaped = self._shaped(names, np.where([n.field == "curve" for n in names], 1.0, x))
        q = curve_nodes(shaped, self.rule)
        scale = np.ones(len(self.template.threads))
        for number, value in zip(names, x, strict=True):
            if number.field == "curve":
                scale[number.which] = value
        return q._replace(psi0=q.psi0 * scale[q.thread], half=q.half * scale[q.thread])

    def _shaped(self, names: Sequence[Number], x: Floats) -> Fabric:
        """The template with the curves and coverages of x, its lobes of one width: they decide how
        curves are cut."""
        shapes = [n for n in names if n.field in SHAPES]
        made = fabric_of(self.template, shapes, x[[n.field in SHAPES for n in names]], {})
        threads = {k: replace(t, gamma_surface=WIDTH) for k, t in made.threads.items()}
        return replace(made, threads=threads)

    def _light(self, names: Sequence[Number], x: Floats) -> Floats | None:
        """The mean of g at the nodes of a cloth, which its curves and coverage make; None under a
        law that masks instead."""
        if not self.law.absolute:
            return None
        shapes = [n for n in names if n.field in SHAPES]
        own = x[[n.field in SHAPES for n in names]]
        if self.held or not shapes:
            return self._light_at((), np.zeros(0)).astype(np.float64)
        steps = np.array([GRID[n.field] for n in shapes])
        first = np.floor(own / steps)
        weights = [_shares(t, smooth=len(shapes) <= 2) for t in own / steps - first]
        total = np.zeros(0)
        for corner in product(*weights):
            weight = math.prod(share for _, share in corner)
            if abs(weight) > 1e-12:
                at = (first + [step for step, _ in corner]) * steps
                means = self._light_at(tuple(shapes), at).astype(np.float64)
                total = weight * means if not total.size else total + weight * means
        return total

    def _light_at(self, shapes: tuple[Number, ...], at: Floats) -> NDArray[np.float32]:
        """`_light` on the grid, in half the memory: a table has two megabytes."""
        key = tuple(float(v) for v in at)

        def make() -> NDArray[np.float32]:
            fabric = self._shaped(shapes, at)
            shadow = compile_shadow(fabric, "horizon", precision=np.float64)
            means = node_means(shadow, self._nodes(shapes, at), fabric)
            assert means is not None
            return means.astype(np.float32)

        return self._means.get(key, make)

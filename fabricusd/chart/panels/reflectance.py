"""Panel: error of the surface law against its time, by model, quadrature and precision."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import plain
from fabricusd.appearance.accuracy import spread_pairs
from fabricusd.appearance.conserving.multiple import conserving_tables
from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.surface import evaluate, far_all, points_all
from fabricusd.appearance.weave.lookup import WeaveHit, lookup
from fabricusd.appearance.weave.place import Places
from fabricusd.appearance.weave.quadrature import CELLS, POINTS, Rule
from fabricusd.chart.panel import Panel, Row
from fabricusd.chart.timing import in_turns, typical
from fabricusd.fabric import Fabric, even
from fabricusd.schema import load

Floats = NDArray[np.float64]
Method = tuple[int, Callable[[], Floats]]
"""(pairs of directions that a call evaluates, the call, which returns CHECKED of the values)."""

QUICK_PRESETS = ("linen_plain", "polyester_satin_charmeuse")
PRESETS = (
    "linen_plain", "silk_crepe_de_chine", "polyester_satin_charmeuse", "silk_shot", "velvet",
)  # fmt: skip
RULES = {
    "points, 3 widths apart": Rule(POINTS, 3.0),
    "points, 2 widths": Rule(POINTS, 2.0),
    "points, 1 width": Rule(POINTS, 1.0),
    "points, 1/2 width": Rule(POINTS, 0.5),
    "points, 1/4 width": Rule(POINTS, 0.25),
    "closed form, 20°": Rule(CELLS, np.radians(20.0)),
    "closed form, 10°": Rule(CELLS, np.radians(10.0)),
    "closed form, 5°": Rule(CELLS, np.radians(5.0)),
    "closed form, 2.5°": Rule(CELLS, np.radians(2.5)),
}
QUICK_RULES = ("points, 2 widths", "points, 1 width", "points, 1/4 width", "closed form, 10°")
BOUNDS = (0.05, 0.01, 0.002)
"""Error bounds for `conserving` cloth, from which its quadrature rules are chosen."""

CHECKED = 512
"""Pairs of directions on which an error is measured."""

REFERENCE_NODES = 256
"""Midpoints on each piece of a curve, for the reference."""

SPLITS = 4
"""Parts into which the pairs are divided to estimate the spread of an error."""


def run(quick: bool) -> list[Row]:
    """Rows of levels `far` and `weave` for every preset."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        return _run(quick)
    finally:
        numba.set_num_threads(before)


def _run(quick: bool) -> list[Row]:
    count, rounds = (4096, 5) if quick else (65536, 7)
    rows = []
    for name in QUICK_PRESETS if quick else PRESETS:
        fabric = even(load(name))
        for model in ("microcylinder",) if quick else ("microcylinder", "thesis"):
            one = replace(fabric, model=model)
            far = f"{name}, far, {model}"
            rows += _group(far, far_reference(one), far_methods(one, count, quick), rounds)
        hit = lookup(fabric, places(fabric, count))
        weave = f"{name}, weave"
        truth = weave_reference(fabric, hit)
        rows += _group(weave, truth, weave_methods(fabric, hit, quick), rounds)
    # These kernels take longer to compile than all the rest takes to run.
    for name in () if quick else QUICK_PRESETS:
        one = replace(even(load(name)), model="conserving")
        truth = _plain_conserving(one, _checked(), REFERENCE_NODES)()
        methods = conserving_methods(one, count // 8)
        rows += _group(f"{name}, far, conserving", truth, methods, rounds)
    return rows


def _group(group: str, truth: Floats, methods: dict[str, Method], rounds: int) -> list[Row]:
    """Rows of methods, timed in turns and compared with `truth` (CHECKED, 3)."""
    taken = in_turns({name: call for name, (_, call) in methods.items()}, rounds)
    rows = []
    for name, (count, call) in methods.items():
        cost, cost_spread = typical(np.array(taken[name]) / count * 1e9)
        error, error_spread = relative_error(call()[:CHECKED], truth)
        rows.append(
            Row(
                group=group,
                method=name,
                cost=cost,
                cost_spread=cost_spread,
                error=error,
                error_spread=error_spread,
            )
        )
    return rows


def relative_error(found: Floats, truth: Floats) -> tuple[float, float]:
    """(mean absolute error over the mean of the truth, its spread over SPLITS parts of pairs)."""
    miss = np.abs(found - truth).mean(axis=1) / truth.mean()
    parts = [float(part.mean()) for part in np.array_split(miss, SPLITS)]
    return float(miss.mean()), typical(parts)[1]


def _checked() -> tuple[Floats, Floats]:
    wi, wo = spread_pairs(CHECKED)
    return wi.T.copy(), wo.T.copy()


def places(fabric: Fabric, count: int) -> Floats:
    """(count, 2) weave coordinates, spread evenly over one repeat by Roberts' sequence."""
    steps = np.array([0.7548776662466927, 0.5698402909980532])
    return np.asarray((np.arange(count)[:, None] * steps) % 1.0 * fabric.weave.cells.shape)


def far_reference(fabric: Fabric) -> Floats:
    """(CHECKED, 3) values of level `far`, by the plain implementation of the law."""
    return plain.far(fabric, *_checked(), per_segment=REFERENCE_NODES)


def weave_reference(fabric: Fabric, hit: WeaveHit, per_segment: int = REFERENCE_NODES) -> Floats:
    """(CHECKED, 3) values of level `weave` at the first places of `hit`, by the plain law."""
    wi, wo = _checked()
    out = np.zeros((CHECKED, 3))
    for share in plain.shares(fabric):
        kind = [t is share.thread for t in fabric.thread_list].index(True)
        sets, threads = hit.set[:CHECKED], hit.thread[:CHECKED]
        mine = (sets == int(share.is_warp)) & (threads == kind)
        psi0 = hit.angle[:CHECKED][mine]
        out[mine] = plain.point(fabric, share, psi0, wi[mine], wo[mine], per_segment=per_segment)
    return out


def _chosen(quick: bool) -> dict[str, Rule]:
    return {k: v for k, v in RULES.items() if not quick or k in QUICK_RULES}


def far_methods(fabric: Fabric, count: int, quick: bool) -> dict[str, Method]:
    """Methods of level `far`: compiled with every rule in both precisions, and NumPy."""
    methods: dict[str, Method] = {}
    for label, rule in _chosen(quick).items():
        methods[f"float32, {label}"] = (count, _far(fabric, rule, count, np.float32))
    for label in ("points, 1 width", "points, 1/4 width"):
        methods[f"float64, {label}"] = (count, _far(fabric, RULES[label], count, np.float64))
    for nodes in (4, 16):
        methods[f"NumPy, {nodes} a piece"] = (CHECKED, _plain_far(fabric, nodes))
    return methods


def _plain_far(fabric: Fabric, nodes: int) -> Callable[[], Floats]:
    pairs = _checked()
    return lambda: plain.far(fabric, *pairs, per_segment=nodes)


def _far(fabric: Fabric, rule: Rule, count: int, real: Any) -> Callable[[], Floats]:
    tables = surface_tables(fabric, precision=real, rule=rule)
    wi, wo = (_first_checked(w, count).astype(real) for w in _checked())
    out = np.empty_like(wi)

    def call() -> Floats:
        far_all(real, tables, wi, wo, out)
        return np.asarray(out.T[:CHECKED], np.float64)

    return call


def _first_checked(w: Floats, count: int) -> Floats:
    """(3, count) - the checked directions, repeated."""
    return np.ascontiguousarray(np.resize(w, (count, 3)).T)


def weave_methods(fabric: Fabric, hit: WeaveHit, quick: bool) -> dict[str, Method]:
    """Methods of level `weave`, as in `far_methods`; the rule is that of the normalisation `Q`."""
    methods: dict[str, Method] = {}
    count = len(hit.set)
    for label, rule in _chosen(quick).items():
        methods[f"float32, {label}"] = (count, _weave(fabric, hit, rule, np.float32))
    one = "points, 1 width"
    methods[f"float64, {one}"] = (count, _weave(fabric, hit, RULES[one], np.float64))
    methods["NumPy, 16 a piece"] = (CHECKED, lambda: weave_reference(fabric, hit, 16))
    return methods


def _weave(fabric: Fabric, hit: WeaveHit, rule: Rule, real: Any) -> Callable[[], Floats]:
    tables = surface_tables(fabric, precision=real, rule=rule)
    wi, wo = (_first_checked(w, len(hit.set)).astype(real) for w in _checked())
    places = Places(hit.set, hit.thread, hit.angle.astype(real), hit.across.astype(real))
    out = np.empty_like(wi)

    def call() -> Floats:
        points_all(real, tables, False, places, wi, wo, out)
        return np.asarray(out.T[:CHECKED], np.float64)

    return call


def conserving_methods(fabric: Fabric, count: int) -> dict[str, Method]:
    """Methods of `conserving` cloth: the public function in float64 at each bound, and NumPy.

    Single scattering only.
    """
    methods: dict[str, Method] = {}
    for bound in BOUNDS:
        methods[f"float64, --max-error {bound:g}"] = (count, _bounded(fabric, bound, count))
    pairs = _checked()
    for nodes in (4, 16):
        methods[f"NumPy, {nodes} a piece"] = (CHECKED, _plain_conserving(fabric, pairs, nodes))
    return methods


def _plain_conserving(
    fabric: Fabric, pairs: tuple[Floats, Floats], nodes: int
) -> Callable[[], Floats]:
    sides = conserving_tables(fabric).sides
    return lambda: plain.conserving_far(fabric, *pairs, per_segment=nodes, sides=sides)


def _bounded(fabric: Fabric, bound: float, count: int) -> Callable[[], Floats]:
    wi, wo = (np.ascontiguousarray(_first_checked(w, count).T) for w in _checked())
    return lambda: evaluate(fabric, wi, wo, max_error=bound, multiple=False)[:CHECKED]


PANEL = Panel(
    name="reflectance",
    title="Reflectance",
    cost="ns an evaluation, one worker",
    error="mean error over mean value",
    about=(
        f"The error is taken on {CHECKED} pairs of directions spread over the hemisphere. The "
        f"reference is the law as it is written, in plain float64 NumPy with {REFERENCE_NODES} "
        "nodes on each piece of a curve. `conserving` is without multiple scattering."
    ),
    run=run,
)

"""What to choose: the method that is the cheapest within a bound most often."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from fabricusd.chart.panel import Row, relative_costs

RELATIVE = (0.3, 0.1, 0.03, 0.01)
DELTA_E = (10.0, 5.0, 2.0)
"""Bounds of relative errors, and of delta E 2000."""

MOST_CASES = 6
"""Cases of a panel beyond which they are not told apart."""


@dataclass(frozen=True, kw_only=True)
class Advice:
    """The method to choose for a bound.

    case : what the groups are alike in, "" for all of the panel
    cost : median over the groups that it was chosen in, over the cheapest method of each
    chosen, within, groups : number of groups in which it is the cheapest within the bound, in which
        any method is within it, and of all
    """

    case: str
    bound: float
    method: str
    cost: float
    chosen: int
    within: int
    groups: int


def advice(rows: Sequence[Row], bounds: Sequence[float]) -> list[Advice]:
    """The method to choose in each case, for each of `bounds` that any method meets.

    The case of a group `linen_plain, weave` is `weave`. A bound that changes neither the choice nor
    where it holds is left out.
    """
    relative = relative_costs(rows)
    cases: dict[str, dict[str, list[tuple[float, Row]]]] = {}
    for row, cost in zip(rows, relative, strict=True):
        case = row.group.partition(", ")[2]
        cases.setdefault(case, {}).setdefault(row.group, []).append((cost, row))
    if len(cases) > MOST_CASES:
        cases = {"": {name: members for case in cases.values() for name, members in case.items()}}
    return [
        one
        for case, groups in cases.items()
        for one in _of_case(case, list(groups.values()), bounds)
    ]


def _of_case(
    case: str, groups: Sequence[Sequence[tuple[float, Row]]], bounds: Sequence[float]
) -> list[Advice]:
    """The choices of one case, the widest bound first; groups : (relative cost, row) of each."""
    found: list[Advice] = []
    for bound in bounds:
        best = [
            min(met, key=lambda pair: pair[0])
            for members in groups
            if (met := [(c, r) for c, r in members if r.error <= bound])
        ]
        if not best:
            continue
        method, chosen = Counter(row.method for _, row in best).most_common(1)[0]
        one = Advice(
            case=case, bound=bound, method=method, chosen=chosen, within=len(best),
            groups=len(groups), cost=median(cost for cost, row in best if row.method == method),
        )  # fmt: skip
        last = found[-1] if found else None
        if last is None or (last.method, last.chosen, last.within) != (method, chosen, len(best)):
            found.append(one)
    return found


def bounds_of(error: str) -> tuple[float, ...]:
    """The bounds that suit a panel whose axis of errors is labelled `error`."""
    return DELTA_E if "delta E" in error else RELATIVE

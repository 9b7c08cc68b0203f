"""What the rules find on one prim."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass

from pxr import Usd

from fabricusd.schema.rules.rules import RULES, Rule, applies, kinds, run

_OF_ANY_PRIM = [rule for rule in RULES if not rule.schema_types]


@dataclass(frozen=True)
class Finding:
    """What one rule found in one place.

    severity : "error" or "warning"
    file : the file that was checked
    prim : path of the prim
    property : name, "" where the whole prim is meant
    problem : reads on from the place: "is 0.8; it must be at least 1"
    """

    rule: str
    severity: str
    file: str
    prim: str
    property: str
    problem: str

    def __str__(self) -> str:
        words = " ".join(filter(None, (self.prim, self.property, self.problem)))
        return f"{self.file}: {words} [{self.rule}]"

    def as_dict(self) -> dict[str, str]:
        """Return the fields for JSON."""
        return asdict(self)


def check_prim(
    prim: Usd.Prim, file: str = "", *, of_rules: Callable[[Rule], bool] = lambda _: True
) -> Iterator[Finding]:
    """The findings on one prim, of every rule or of some."""
    of = kinds(prim)
    # Most prims of a garment are neither fabrics nor bound to one.
    for checked in RULES if of else _OF_ANY_PRIM:
        if of_rules(checked) and applies(checked, prim, of):
            for name, problem in run(checked, prim):
                yield Finding(
                    checked.name, checked.severity, file, str(prim.GetPath()), name, problem
                )


def faults(prim: Usd.Prim) -> list[Finding]:
    """The findings that keep a prim from being read."""
    return list(check_prim(prim, of_rules=lambda checked: checked.blocks))


def remarks(prim: Usd.Prim) -> list[Finding]:
    """The findings that readers pass on as notes."""
    return list(check_prim(prim, of_rules=lambda checked: checked.noted))

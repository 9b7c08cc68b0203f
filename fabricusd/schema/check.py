"""`check`: every rule over every fabric, thread and binding of a stage."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass

from pxr import Usd

from fabricusd.errors import reads
from fabricusd.schema.access import PRESENT
from fabricusd.schema.anysource import is_draft, load_any
from fabricusd.schema.rules.rules import RULES, applies, kinds, run
from fabricusd.schema.source import find_prim, no_warnings, open_stage, split_source, usd_errors

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
        """For JSON."""
        return asdict(self)


def check_prim(prim: Usd.Prim, file: str = "", *, fatal: bool = False) -> Iterator[Finding]:
    """The findings on one prim; where `fatal`, those alone that keep it from being read."""
    of = kinds(prim)
    # Most prims of a garment are none of ours.
    for checked in RULES if of else _OF_ANY_PRIM:
        wanted = not fatal or (checked.fatal and checked.severity == "error")
        if wanted and applies(checked, prim, of):
            for name, problem in run(checked, prim):
                yield Finding(
                    checked.name, checked.severity, file, str(prim.GetPath()), name, problem
                )


@reads("a fabric")
def check(source: str | os.PathLike[str]) -> list[Finding]:
    """Every finding in a USD file or a preset, in stage order; of a draft, what its import assumed.

    `FILE:/PRIM` is that prim and what is below it. FabricError where the file cannot be opened as
    USD, or does not compose, or is no draft, or has no such prim.
    """
    if is_draft(source):
        _, notes = load_any(source)
        return [Finding("DraftIsComplete", "warning", str(source), "", "", note) for note in notes]
    stage, file = open_stage(source)
    findings: list[Finding] = []
    top = find_prim(stage, file, split_source(source)[1] or "/")
    with usd_errors(file, "checked"), no_warnings():
        for prim in Usd.PrimRange(top, Usd.TraverseInstanceProxies(PRESENT)):
            # A prim that is only overridden here is defined in a layer that is not.
            if prim.IsDefined() or prim.HasDefiningSpecifier():
                findings.extend(check_prim(prim, file))
    return findings

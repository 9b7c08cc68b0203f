"""`check`: every rule over every fabric, thread and binding of a stage."""

from __future__ import annotations

import os

from pxr import Usd

from fabricusd.errors import reads
from fabricusd.schema.access import PRESENT
from fabricusd.schema.anysource import is_draft, load_any
from fabricusd.schema.findings import Finding, check_prim
from fabricusd.schema.source import find_prim, no_warnings, open_stage, split_source, usd_errors

__all__ = ["Finding", "check"]


@reads("a fabric")
def check(source: str | os.PathLike[str]) -> list[Finding]:
    """Return the findings in a USD file or a preset, in stage order, or a draft's import notes.

    `FILE:/PRIM` checks that prim and what is below it. Raises FabricError where the file cannot be
    opened as USD or read as a draft, does not compose, or has no such prim.
    """
    if is_draft(source):
        _, notes = load_any(source)
        return [Finding("DraftIsComplete", "warning", str(source), "", "", note) for note in notes]
    stage, file = open_stage(source)
    findings: list[Finding] = []
    top = find_prim(stage, file, split_source(source)[1] or "/")
    with usd_errors(file, "checked"), no_warnings():
        for prim in Usd.PrimRange(top, Usd.TraverseInstanceProxies(PRESENT)):
            # A prim that is only overridden here is defined in a layer that is not checked.
            if prim.IsDefined() or prim.HasDefiningSpecifier():
                findings.extend(check_prim(prim, file))
    return findings

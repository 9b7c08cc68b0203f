"""`fabricusd check`."""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

from fabricusd.errors import FabricError, one_line

EPILOG = """exit status: 0 no errors, 1 errors were found, 2 a file cannot be read

example:
  fabricusd check garment.usda fabrics/*.usda
  fabricusd check --list-rules"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which files to check, and how to judge and print the findings."""
    parser.add_argument(
        "files", nargs="*", metavar="FILE", help="USD file, FILE:/PRIM, draft or preset"
    )
    parser.add_argument("--strict", action="store_true", help="exit with status 1 on warnings, too")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")
    parser.add_argument("--list-rules", action="store_true", help="list the rules and exit")


def run(options: argparse.Namespace) -> int:
    """Print the findings for every file, and then the files that cannot be read."""
    from fabricusd.schema.check import check
    from fabricusd.schema.rules.rules import RULES

    if options.list_rules:
        for rule in RULES:
            print(f"{rule.name:24} {rule.severity:8} {rule.doc}")
        return 0
    if not options.files:
        raise FabricError("FILE", "is missing; name at least one file or preset")
    findings: list[Any] = []
    unreadable: list[FabricError] = []
    for file in options.files:
        try:
            findings.extend(check(file))
        except FabricError as error:
            unreadable.append(error)
    if options.json:
        print(json.dumps([finding.as_dict() for finding in findings], indent=2))
    else:
        for finding in findings:
            print(one_line(f"{finding.severity}: {finding}"))
    for refusal in unreadable:
        print(one_line(f"fabricusd: {refusal}"), file=sys.stderr)
    errors = sum(finding.severity == "error" for finding in findings)
    warnings = len(findings) - errors
    checked = len(options.files) - len(unreadable)
    if checked and not options.quiet and not options.json:
        print(
            f"{_count(checked, 'file')}: {_count(errors, 'error')}, {_count(warnings, 'warning')}",
            file=sys.stderr,
        )
    if unreadable:
        return 2
    return 1 if errors or (options.strict and warnings) else 0


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"

"""The table of rules: what one is, how it is registered, how it is run."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from pxr import Tf, Usd

from fabricusd.errors import one_line
from fabricusd.schema.access import BACK, applies_binding, thread_prims, type_of

Fault = tuple[str, str]
RuleFunction = Callable[[Usd.Prim], Iterable[Fault]]

FABRIC, THREAD, BINDING = "FabricusdWovenFabric", "FabricusdWovenThread", "FabricusdWovenBindingAPI"


@dataclass(frozen=True)
class Rule:
    """One rule.

    severity : "error" or "warning"
    schema_types : of the prims it looks at; () for all
    fatal : whether a prim with an error of this rule cannot be read
    undefined : whether it looks only at prims that USD does not take for defined
    sound : whether it looks only at prims that can be read, their threads included
    noted : whether readers pass a warning of this rule on
    """

    name: str
    severity: str
    schema_types: tuple[str, ...]
    doc: str
    function: RuleFunction
    fatal: bool
    undefined: bool
    sound: bool
    noted: bool

    @property
    def blocks(self) -> bool:
        """Whether a fault keeps a prim from being read."""
        return self.fatal and self.severity == "error"


RULES: list[Rule] = []


def rule(
    *schema_types: str,
    severity: str = "error",
    fatal: bool = True,
    undefined: bool = False,
    sound: bool = False,
    noted: bool = False,
) -> Callable[[RuleFunction], RuleFunction]:
    """Register a function as the rule whose name is the function's in CamelCase."""

    def register(function: RuleFunction) -> RuleFunction:
        name = "".join(word.capitalize() for word in function.__name__.split("_"))
        doc = " ".join((function.__doc__ or "").split())
        RULES.append(
            Rule(name, severity, schema_types, doc, function, fatal, undefined, sound, noted)
        )
        return function

    return register


def kinds(prim: Usd.Prim) -> frozenset[str]:
    """The schema types that a prim is of: FABRIC or THREAD, and BINDING."""
    found = {f"Fabricusd{type_of(prim)}"} & {FABRIC, THREAD}
    if applies_binding(prim) or prim.HasRelationship("fabric:binding"):
        found.add(BINDING)
    return frozenset(found)


def applies(checked: Rule, prim: Usd.Prim, of: frozenset[str] | None = None) -> bool:
    """Whether `prim` is one that the rule looks at; `of` is its `kinds`, where they are known."""
    if checked.schema_types and (kinds(prim) if of is None else of).isdisjoint(
        checked.schema_types
    ):
        return False
    return not (checked.undefined and prim.IsDefined())


def is_sound(prim: Usd.Prim) -> bool:
    """Whether no rule keeps a prim, or a thread of it, from being read; its back does not count."""
    threads = thread_prims(prim) if type_of(prim) == "WovenFabric" else []
    return not any(
        name != BACK
        for each in (prim, *threads)
        for checked in RULES
        if checked.blocks and applies(checked, each)
        for name, _ in run(checked, each)
    )


def run(checked: Rule, prim: Usd.Prim) -> list[Fault]:
    """The faults that one rule finds on one prim, with values that cannot be read as faults."""
    try:
        if checked.sound and not is_sound(prim):
            return []  # the rule that keeps it from being read tells why
        return list(checked.function(prim))
    except Tf.ErrorException as error:
        return [("", f"cannot be read: {one_line(str(error), 300)}; it must be whole")]
    except TypeError:
        # Of a wrong type in a layer, or of a damaged .usdc in which type and value disagree.
        return [("", "holds a value of a wrong type; each must be of the schema's type")]

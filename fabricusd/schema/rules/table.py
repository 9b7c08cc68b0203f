"""The table of rules: what one is, how it is registered, how it is run."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from pxr import Tf, Usd

from fabricusd.errors import one_line
from fabricusd.schema.access import applies_binding, type_of

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
    """

    name: str
    severity: str
    schema_types: tuple[str, ...]
    doc: str
    function: RuleFunction
    fatal: bool
    undefined: bool


RULES: list[Rule] = []


def rule(
    *schema_types: str, severity: str = "error", fatal: bool = True, undefined: bool = False
) -> Callable[[RuleFunction], RuleFunction]:
    """Register a function as the rule whose name is the function's in CamelCase."""

    def register(function: RuleFunction) -> RuleFunction:
        name = "".join(word.capitalize() for word in function.__name__.split("_"))
        doc = " ".join((function.__doc__ or "").split())
        RULES.append(Rule(name, severity, schema_types, doc, function, fatal, undefined))
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


def run(checked: Rule, prim: Usd.Prim) -> list[Fault]:
    """The faults that one rule finds on one prim, with values that cannot be read as faults."""
    try:
        return list(checked.function(prim))
    except Tf.ErrorException as error:
        return [("", f"cannot be read: {one_line(str(error), 300)}; it must be whole")]
    except TypeError:
        # Of a wrong type in a layer, or of a damaged .usdc in which type and value disagree.
        return [("", "holds a value of a wrong type; each must be of the schema's type")]

"""Write docs/schema.md from the registered schema and the rules."""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf, Usd

from fabricusd.schema.rules.rules import RULES

HERE = Path(__file__).resolve().parent
TYPES = (
    ("WovenFabric", "A prim type."),
    (
        "WovenThread",
        "A prim type. A thread is a child of its WovenFabric, or lies anywhere that "
        "`fabric:threads` names.",
    ),
    ("WovenBindingAPI", "A single-apply API schema, on a Mesh or a GeomSubset."),
)


def table(name: str) -> list[str]:
    """A table with a row for each property of a schema type."""
    registry = Usd.SchemaRegistry()
    definition = registry.FindConcretePrimDefinition(name)
    definition = definition or registry.FindAppliedAPIPrimDefinition(name)
    rows = ["| property | type | fallback | meaning |", "|---|---|---|---|"]
    for prop in definition.GetPropertyNames():
        if definition.GetSpecType(prop) != Sdf.SpecTypeAttribute:
            kind, fallback = "rel", ""
        else:
            attribute = definition.GetAttributeDefinition(prop)
            kind, fallback = str(attribute.GetTypeName()), str(attribute.GetFallbackValue())
            if allowed := attribute.GetMetadata("allowedTokens"):
                kind = " \\| ".join(allowed)
        rows.append(
            f"| `{prop}` | {kind} | {fallback} | {definition.GetPropertyDocumentation(prop)} |"
        )
    return rows


def main() -> None:
    """Write the page."""
    lines = [
        "# The schema",
        "",
        "`python docs/make_schema.py` makes this page from the registered schema. To change it, "
        "edit"
        " `fabricusd/schema/schema.usda` and run `make schema`.",
        "",
    ]
    for name, what in TYPES:
        lines += [f"## {name}", "", what, "", *table(name), ""]
    lines += [
        "## Rules",
        "",
        "`fabricusd check` and USD's own validation report where a rule does not hold.",
        "",
    ]
    lines += ["| rule | severity | the rule |", "|---|---|---|"]
    lines += [f"| {rule.name} | {rule.severity} | {rule.doc} |" for rule in RULES]
    (HERE / "schema.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()

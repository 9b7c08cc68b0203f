"""Which kernels the page needs, and what in them is not translated but said in GLSL."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fabricusd.appearance import laws
from fabricusd.appearance.conserving.levels import conserving_level_value
from fabricusd.appearance.conserving.multiple import conserving_value
from fabricusd.appearance.fuzz import fuzz_over
from fabricusd.appearance.published.far import far_value
from fabricusd.appearance.published.levels import point_value
from fabricusd.appearance.shadow.horizon_lookup import entry_at
from fabricusd.appearance.shadow.mean import mean_over
from fabricusd.appearance.shadow.methods import shade
from fabricusd.appearance.weave.lookup import split, thread_at
from fabricusd.appearance.weave.place import Hit, Place
from fabricusd.kernels import real
from fabricusd.preview.glsl.tables import declarations, fields
from fabricusd.preview.glsl.translate import Translation, passes
from fabricusd.preview.glsl.values import FLOAT, INT, REAL, Group, Several, Value, constant

SHADER = Path(__file__).resolve().parents[1] / "page" / "kernels.glsl"
"""The translation, which comes with the package."""

LAWS = tuple(laws.REGISTRY)
"""Value of the macro LAW -> name of the surface law."""

FACES = ("exp", "log", "sin", "cos", "atan2", "asin", "acos", "erf", "i0e")
"""Elementary functions of kernels, which are translated as their float32 versions."""

LAW_PARTS = (
    "shared",
    "view_place",
    "visible_shares",
    "weight",
    "mask",
    "total",
    "openness",
    "lit_alone",
)

SPLIT = ("i", "j", "end", "pick", "x", "y")
"""What `lookup.split` finds; the page holds it in variables, since GLSL has no doubles."""

ROOTS: tuple[tuple[Any, str], ...] = (
    (far_value, "R published f f f f f f"),
    (point_value, "R published false place f f f f f f"),
    (conserving_value, "R conserving f f f f f f"),
    (conserving_level_value, "R conserving false place f f f f f f"),
    (thread_at, "R cloth i i i i f f"),
    (shade, "R cloth shadow f f hit f f f"),
    (fuzz_over, "R fuzz i f f f f f f f f f"),
    (point_value, "R published true place f f f f f f"),
    (conserving_level_value, "R conserving true place f f f f f f"),
)
"""Kernels, and the types of their arguments: R, a group of tables, f(loat), i(nt), a struct."""


def shader() -> str:
    """The GLSL of all kernels that the page needs."""
    special: dict[int, Any] = {
        id(split): _split, id(entry_at): _entry, id(real._unless_nan): _nan,
        id(mean_over): _mean, id(mean_over.py_func): _mean,
    }  # fmt: skip
    for name in FACES:
        single = real._atan2_32 if name == "atan2" else getattr(real, f"_{name}32")
        special[id(getattr(real, name))] = _precise(single)
    for name in LAW_PARTS:
        special[id(getattr(laws, name))] = _by_law(name)
    made = Translation(fields(), special, chosen)
    made.struct(Place, (INT, INT, FLOAT, FLOAT, FLOAT))
    made.struct(Hit, (INT, INT, FLOAT, FLOAT, FLOAT))
    kinds = {
        "f": Value("", FLOAT), "i": Value("", INT), "R": Value("", REAL),
        "false": constant(False), "true": constant(True),
        "place": Value("", Place), "hit": Value("", Hit),
    }  # fmt: skip
    for kernel, types in ROOTS:
        made.call(kernel, [kinds.get(t) or Value("", Group(t)) for t in types.split()])
    head = [
        "// Made by `python -m fabricusd.preview.glsl` of the kernels in fabricusd.appearance",
        *(f"#define {name.upper()} {number}" for number, name in enumerate(LAWS)),
        "ivec4 split_cell; vec2 split_place; ivec2 split_entry;",
    ]
    return "\n".join(head) + "\n" + declarations() + "\n" + "\n".join(made.text)


def _precise(single: Any) -> Any:
    def call(translation: Translation, arguments: list[Value]) -> Value:
        return translation.call(single, arguments)

    return call


def _nan(translation: Translation, arguments: list[Value]) -> Value:
    """Directions on the page are finite."""
    return arguments[1]


def _mean(translation: Translation, arguments: list[Value]) -> Value:
    _, table, _, here, beside, c, level = arguments
    given = ", ".join(a.code for a in (here, beside, c, level))
    return Value(f"mean_of_groups({table.type.name}_at, {given})", FLOAT)


def _split(translation: Translation, arguments: list[Value]) -> Value:
    kind = Several((INT,) * 4 + (FLOAT,) * 2)
    name = translation.glsl_type(kind)
    given = [f"split_cell.{c}" for c in "xyzw"] + ["split_place.x", "split_place.y"]
    return Value(f"{name}({', '.join(given)})", kind)


def _entry(translation: Translation, arguments: list[Value]) -> Value:
    kind = Several((INT, INT))
    return Value(f"{translation.glsl_type(kind)}(split_entry.x, split_entry.y)", kind)


def _parameters(
    translation: Translation, arguments: list[Value]
) -> tuple[list[Value], str, list[str]]:
    """(arguments inside a new function, its parameters, what its caller passes)."""
    inside, head, given = [], [], []
    for k, argument in enumerate(arguments):
        if not passes(argument):
            inside.append(argument)
            continue
        inside.append(Value(f"a{k}", argument.type))
        head.append(f"{translation.glsl_type(argument.type)} a{k}")
        given.append(argument.code)
    return inside, ", ".join(head), given


def _by_law(part: str) -> Any:
    """A function that is chosen by the macro LAW."""
    made: dict[Any, tuple[str, Any]] = {}

    def call(translation: Translation, arguments: list[Value]) -> Value:
        inside, head, given = _parameters(translation, arguments)
        key = tuple(a.type for a in arguments)
        if key not in made:
            calls = [
                (law, translation.call(getattr(laws.REGISTRY[law], part), inside)) for law in LAWS
            ]
            kind = next((c.type for _, c in calls))
            name = translation.unique(f"law_{part}")
            lines = [f"{translation.glsl_type(kind)} {name}({head}) {{"]
            for number, (law, found) in enumerate(calls):
                lines += [f"{'#elif' if number else '#if'} LAW == {law.upper()}",
                          f"  return {found.code};"]  # fmt: skip
            translation.text.append("\n".join([*lines, "#endif", "}\n"]))
            made[key] = name, kind
        name, kind = made[key]
        return Value(f"{name}({', '.join(given)})", kind)

    return call


def chosen(translation: Translation, function: Any, arguments: list[Value]) -> Value:
    """A call of what `choice.by_number` made: a function that compares the number."""
    cases, last = [], function
    while "ours" in (cells := _cells(last)):
        cases.append((cells["ours"], cells["function"]))
        last = cells["otherwise"]
    rest = [arguments[0], *arguments[2:]]
    inside, head, given = _parameters(translation, rest)
    name = translation.unique("chosen")
    final = translation.call(_cells(last)["function"], inside)
    lines = [
        f"  if (number == {number}) return {translation.call(one, inside).code};"
        for number, one in cases
    ]
    kind = translation.glsl_type(final.type)
    text = [f"{kind} {name}(int number, {head}) {{", *lines, f"  return {final.code};", "}\n"]
    translation.text.append("\n".join(text))
    return Value(f"{name}({', '.join([arguments[1].code, *given])})", final.type)


def _cells(function: Any) -> dict[str, Any]:
    python = getattr(function, "py_func", function)
    names = python.__code__.co_freevars
    return dict(zip(names, (c.cell_contents for c in python.__closure__ or ()), strict=True))

"""Translate kernels: one GLSL function for each function and types of its arguments."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable
from typing import Any

from fabricusd.preview.glsl.expressions import Expressions
from fabricusd.preview.glsl.values import BOOL, FLOAT, INT, REAL, Row, Several, Value, as_type

_WORDS = """
half out in inout flat smooth sample filter input output far near precision length step mix sign
fract mod min max exp log sin cos tan asin acos atan sqrt abs floor ceil round dot cross distance
reflect refract any all not true false const uniform varying texture active common partition
resource cast namespace using row_major patch
"""
TAKEN = frozenset(_WORDS.split())
"""Words that a variable of a kernel may have for a name, but not one of GLSL."""


class Promoted(Exception):
    """A variable that began as an int is a float."""


class Translation:
    """All functions that were translated, in the order in which GLSL needs them.

    fields : what the members of groups of tables are, see `tables.fields`
    special : id of a function -> (translation, arguments) -> Value, for what is not translated
    choose : translates a call of what `kernels.choice` made
    """

    def __init__(
        self,
        fields: dict[Any, Value],
        special: dict[int, Callable[..., Value]],
        choose: Callable[[Translation, Any, list[Value]], Value],
    ) -> None:
        self.fields, self.special = fields, special
        self.choose = choose
        self.text: list[str] = []
        self.structs: dict[Any, tuple[str, list[tuple[str, Any]]]] = {}
        self.functions: dict[Any, tuple[str, Any]] = {}
        self.names: dict[str, int] = {}

    def call(self, function: Any, arguments: list[Value]) -> Value:
        """A call of a kernel, which is translated first if it has not been."""
        python = getattr(function, "py_func", function)
        handler = self.special.get(id(function)) or self.special.get(id(python))
        if handler is not None:
            return handler(self, arguments)
        if python.__module__ == "fabricusd.kernels.choice":
            return self.choose(self, function, arguments)
        key = (python, tuple(self._key(a) for a in arguments))
        if key not in self.functions:
            self.functions[key] = self._function(python, arguments)
        name, returned = self.functions[key]
        given = ", ".join(a.code for a in arguments if passes(a))
        return Value(f"{name}({given})", returned)

    def _key(self, argument: Value) -> Any:
        # A truth that is known chooses a branch, so it makes another function.
        known = argument.known and argument.type == BOOL
        return argument.type, argument.value if known else None

    def _function(self, python: Any, arguments: list[Value]) -> tuple[str, Any]:
        promoted: set[str] = set()
        while True:
            try:
                body = _Function(self, python, arguments, promoted)
                break
            except Promoted as found:
                promoted.add(str(found))
        name = self.unique(python.__name__.lstrip("_"))
        self.text.append(body.text(name))
        return name, body.returned

    def unique(self, stem: str) -> str:
        """A name for a function that none has yet."""
        number = self.names.get(stem, 0)
        self.names[stem] = number + 1
        return f"k_{stem}" + (f"_{number}" if number else "")

    def struct(self, kind: Any, types: tuple[Any, ...]) -> str:
        """The name of the struct of a tuple of these types; kind : a NamedTuple class or None."""
        key = kind or types
        if key not in self.structs:
            names = kind._fields if kind else [f"m{k}" for k in range(len(types))]
            name = kind.__name__ if kind else "T_" + "".join(self.glsl_type(t)[0] for t in types)
            fields = [(f"{n}_", t) for n, t in zip(names, types, strict=True)]
            self.structs[key] = name, fields
            members = " ".join(f"{self.glsl_type(t)} {n};" for n, t in fields)
            self.text.append(f"struct {name} {{ {members} }};\n")
        return self.structs[key][0]

    def glsl_type(self, kind: Any) -> str:
        """The name of a type in GLSL."""
        if isinstance(kind, Several):
            return self.struct(None, kind.types)
        if isinstance(kind, Row):
            return INT
        return kind if isinstance(kind, str) else self.struct(kind, ())


def passes(argument: Value) -> bool:
    """Whether a GLSL function takes this argument: tables are global, known truths are chosen."""
    if argument.type == BOOL and argument.known:
        return False
    if isinstance(argument.type, str):
        return argument.type != REAL
    return isinstance(argument.type, Row | type)


class _Function(Expressions):
    """One function while it is translated."""

    def __init__(
        self, translation: Translation, python: Any, arguments: list[Value], promoted: set[str]
    ) -> None:
        self.translation, self.python, self.promoted = translation, python, promoted
        tree: Any = ast.parse(textwrap.dedent(inspect.getsource(python))).body[0]
        self.outside = {**python.__globals__, **_closure(python)}
        self.known: dict[str, Value] = {}
        self.types: dict[str, Any] = {}
        self.declared: list[str] = []
        self.lines: list[str] = []
        self.returned: Any = None
        self.made = 0
        counts = _assignments(tree)
        self.once = {name for name, count in counts.items() if count == 1}
        parameters = [a.arg for a in tree.args.args]
        defaults = [None] * (len(parameters) - len(tree.args.defaults)) + tree.args.defaults
        self.parameters: list[str] = []
        self.pad = "  "
        for k, name in enumerate(parameters):
            given = arguments[k] if k < len(arguments) else self.expression(defaults[k])
            if passes(given):
                self.types[name] = given.type
                self.parameters.append(f"{translation.glsl_type(given.type)} {self.variable(name)}")
            else:
                self.known[name] = given
        self.block(tree.body)

    def text(self, name: str) -> str:
        """The whole function."""
        head = f"{self.translation.glsl_type(self.returned)} {name}({', '.join(self.parameters)})"
        return "\n".join([head + " {", *self.declared, *self.lines, "}\n"])

    def variable(self, name: str) -> str:
        """A kernel's variable in GLSL."""
        return f"{name}_" if name in TAKEN or name.startswith("gl_") else name

    def add(self, line: str) -> None:
        """Add a line of the function."""
        self.lines.append(self.pad + line)

    def held(self, value: Value) -> Value:
        """The value in a variable of its own, so that it is computed once."""
        self.made += 1
        name = f"t{self.made}"
        self.declared.append(f"  {self.translation.glsl_type(value.type)} {name};")
        self.add(f"{name} = {value.code};")
        return Value(name, value.type)

    def block(self, body: list[ast.stmt]) -> bool:
        """Translate statements; whether the last one ended the function for sure."""
        return any(self.statement(statement) for statement in body)

    def inner(self, body: list[ast.stmt]) -> None:
        """Translate statements one step further in."""
        before, self.pad = self.pad, self.pad + "  "
        self.block(body)
        self.pad = before

    def statement(self, node: ast.stmt) -> bool:
        """Translate one statement; whether it ends the function."""
        if isinstance(node, ast.Return):
            self.give(self.expression(node.value))  # type: ignore[arg-type]
            return True
        if isinstance(node, ast.If):
            return self.branch(node)
        if isinstance(node, ast.Assign):
            self.assign_all(node.targets[0], node.value)
        elif isinstance(node, ast.AugAssign):
            whole = ast.BinOp(ast.copy_location(_read(node.target), node), node.op, node.value)
            self.assign(node.target.id, self.expression(whole))  # type: ignore[union-attr]
        elif isinstance(node, ast.For):
            self.loop(node)
        elif isinstance(node, ast.While):
            self.add(f"while ({as_type(self.expression(node.test), BOOL)}) {{")
            self.inner(node.body)
            self.add("}")
        elif isinstance(node, ast.Continue | ast.Break):
            self.add("continue;" if isinstance(node, ast.Continue) else "break;")
        elif not isinstance(node, ast.Expr):
            raise NotImplementedError(f"{self.python.__name__}: {ast.dump(node)}")
        return False

    def branch(self, node: ast.If) -> bool:
        """An `if`; where its test is known, only what is taken."""
        test = self.expression(node.test)
        if test.known:
            return self.block(node.body if test.value else node.orelse)
        self.add(f"if ({as_type(test, BOOL)}) {{")
        self.inner(node.body)
        if node.orelse:
            self.add("} else {")
            self.inner(node.orelse)
        self.add("}")
        return False

    def loop(self, node: ast.For) -> None:
        """A `for` over a range, or over a tuple of consecutive numbers."""
        name = node.target.id  # type: ignore[attr-defined]
        if isinstance(node.iter, ast.Tuple):
            numbers = [self.expression(e).value for e in node.iter.elts]
            if numbers != list(range(numbers[0], numbers[-1] + 1)):
                raise NotImplementedError(ast.unparse(node.iter))
            low, high = str(numbers[0]), str(numbers[-1] + 1)
        else:
            ends = [as_type(self.expression(a), INT) for a in node.iter.args]  # type: ignore[attr-defined]
            low, high = ends if len(ends) == 2 else ("0", ends[0])
        variable = self.variable(name)
        self.types[name] = INT
        self.add(f"for (int {variable} = {low}; {variable} < {high}; ++{variable}) {{")
        self.inner(node.body)
        self.add("}")
        del self.types[name]

    def assign_all(self, target: ast.expr, node: ast.expr) -> None:
        """`name = value` or `a, b = values`."""
        if isinstance(target, ast.Name):
            self.assign(target.id, self.expression(node))
            return
        names = [t.id for t in target.elts]  # type: ignore[attr-defined]
        values = self.parts(node, len(names))
        read = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
        if read & set(names):
            values = [v if v.known or not passes(v) else self.held(v) for v in values]
        for name, value in zip(names, values, strict=True):
            if name != "_":
                self.assign(name, value)

    def assign(self, name: str, value: Value) -> None:
        """Set a variable, which is declared at the head of the function."""
        alone = name in self.once and name not in self.types
        if alone and (value.known or not passes(value)):
            self.known[name] = value
            return
        kind = self.types.get(name)
        if kind is None:
            kind = FLOAT if name in self.promoted else value.type
            self.types[name] = kind
            declared = f"  {self.translation.glsl_type(kind)} {self.variable(name)};"
            if declared not in self.declared:
                self.declared.append(declared)
        if kind == INT and value.type == FLOAT:
            raise Promoted(name)
        code = as_type(value, kind) if isinstance(kind, str) else value.code
        self.add(f"{self.variable(name)} = {code};")

    def give(self, value: Value) -> None:
        """`return`; all returns of a function have the type of the first."""
        if self.returned is None:
            self.returned = FLOAT if "return" in self.promoted else value.type
        elif self.returned == INT and value.type == FLOAT:
            raise Promoted("return")
        kind = self.returned
        if isinstance(kind, str):
            self.add(f"return {as_type(value, kind)};")
        elif isinstance(kind, Several) and value.type != kind:
            values = self.split(value)
            codes = [as_type(v, t) for v, t in zip(values, kind.types, strict=True)]
            self.add(f"return {self.translation.glsl_type(kind)}({', '.join(codes)});")
        else:
            self.translation.glsl_type(kind)
            self.add(f"return {value.code};")


def _read(target: ast.expr) -> ast.expr:
    return ast.Name(target.id, ast.Load())  # type: ignore[attr-defined]


def _closure(python: Any) -> dict[str, Any]:
    cells = python.__closure__ or ()
    return {n: c.cell_contents for n, c in zip(python.__code__.co_freevars, cells, strict=True)}


def _assignments(tree: ast.AST) -> dict[str, int]:
    """How often each name is set; inside a loop counts as often."""
    counts: dict[str, int] = {}
    for node in ast.walk(tree):
        targets: list[ast.expr] = []
        if isinstance(node, ast.Assign):
            targets = node.targets
        elif isinstance(node, ast.AugAssign | ast.For):
            targets = [node.target, node.target]
        for target in targets:
            for one in ast.walk(target):
                if isinstance(one, ast.Name):
                    counts[one.id] = counts.get(one.id, 0) + 1
    return counts

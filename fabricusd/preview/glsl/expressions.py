"""Translate the expressions of a kernel."""

from __future__ import annotations

import ast
import math
import re
from typing import Any

import numpy as np

from fabricusd.kernels.real import index, whole
from fabricusd.preview.glsl.values import (
    BOOL,
    FLOAT,
    INT,
    Group,
    Row,
    Several,
    Shape,
    Table,
    Value,
    as_type,
    constant,
)

BINARY = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "/",
          ast.Mod: "%", ast.RShift: ">>", ast.LShift: "<<"}  # fmt: skip
COMPARE = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
MATH = {math.sqrt: "sqrt", math.exp: "exp", math.tan: "tan", np.floor: "floor"}
INTS = (int, np.int32, np.int64, np.uintp, np.uint32)
FLOATS = (float, np.float32)

_CALL = re.compile(r"\b(?:[FIB]|k_\w+|law_\w+)\(")
"""Reading a table, or calling a kernel."""


class Expressions:
    """The part of a function's translation that has to do with expressions."""

    translation: Any
    known: dict[str, Value]
    types: dict[str, Any]
    outside: dict[str, Any]

    def variable(self, name: str) -> str:
        """A kernel's variable in GLSL."""
        raise NotImplementedError

    def held(self, value: Value) -> Value:
        """The value in a variable of its own."""
        raise NotImplementedError

    def expression(self, node: ast.expr) -> Value:
        """Any expression."""
        found: Value = getattr(self, f"of_{type(node).__name__}")(node)
        return found

    def object(self, node: ast.expr) -> Any:
        """What a name or an attribute outside of the function is; None for anything else."""
        if isinstance(node, ast.Name):
            if node.id in self.known or node.id in self.types:
                return None
            builtins = {"int": int, "float": float, "abs": abs, "min": min, "max": max}
            return self.outside.get(node.id, builtins.get(node.id))
        if isinstance(node, ast.Attribute):
            base = self.object(node.value)
            return None if base is None else getattr(base, node.attr, None)
        return None

    def of_Constant(self, node: ast.Constant) -> Value:
        """A literal."""
        return constant(node.value)

    def of_Name(self, node: ast.Name) -> Value:
        """A variable, or a constant of the module."""
        if node.id in self.known:
            return self.known[node.id]
        if node.id in self.types:
            return Value(self.variable(node.id), self.types[node.id])
        found = self.outside.get(node.id)
        if isinstance(found, bool | int | float | np.number):
            return constant(found.item() if isinstance(found, np.number) else found)
        raise NotImplementedError(f"{node.id} is {found!r}")

    def of_Attribute(self, node: ast.Attribute) -> Value:
        """A constant of a module, a field of a struct or of a group, or the shape of an array."""
        found = self.object(node)
        if isinstance(found, bool | int | float | np.number):
            return constant(found.item() if isinstance(found, np.number) else found)
        base = self.expression(node.value)
        if isinstance(base.type, Group):
            field: Value = self.translation.fields[f"{base.type.name}.{node.attr}"]
            return field
        if isinstance(base.type, Table) and node.attr == "shape":
            return Value("", Shape(base.type))
        if isinstance(base.type, Table) and node.attr == "size":
            return Value(" * ".join(_side(base.type, k) for k in range(base.type.dimensions)), INT)
        _, fields = self.translation.structs[base.type]
        return Value(f"{base.code}.{node.attr}_", dict(fields)[f"{node.attr}_"])

    def of_Subscript(self, node: ast.Subscript) -> Value:
        """An entry of an array, a row of it, or one of its sides."""
        base = self.expression(node.value)
        at = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if isinstance(base.type, Shape):
            return self._side_of(base.type.table, at[0])
        places = [as_type(self.expression(a), INT) for a in at]
        if isinstance(base.type, Row):
            return self._entry(base.type.table, [base.code, *places])
        if isinstance(base.type, Table):
            if len(places) < base.type.dimensions:
                return Value(places[0], Row(base.type))
            known = self.translation.fields.get((base.type.name, *places[1:]))
            return known or self._entry(base.type, places)
        raise NotImplementedError(ast.unparse(node))

    def _side_of(self, table: Table, at: ast.expr) -> Value:
        if isinstance(at, ast.IfExp):
            test = as_type(self.expression(at.test), BOOL)
            a, b = (self._side_of(table, n).code for n in (at.body, at.orelse))
            return Value(f"({test} ? {a} : {b})", INT)
        return Value(_side(table, int(self.expression(at).value)), INT)

    def _entry(self, table: Table, places: list[str]) -> Value:
        code = places[0]
        for k, place in enumerate(places[1:], 1):
            code = f"({code}) * {_side(table, k)} + {place}"
        reader = {FLOAT: "F", INT: "I", "byte": "B"}[table.kind]
        return Value(f"{reader}({table.name}_at + {code})", FLOAT if table.kind == FLOAT else INT)

    def of_UnaryOp(self, node: ast.UnaryOp) -> Value:
        """`-x` or `not x`."""
        value = self.expression(node.operand)
        if isinstance(node.op, ast.Not):
            if value.known:
                return constant(not value.value)
            return Value(f"!({as_type(value, BOOL)})", BOOL)
        if value.known:
            return constant(-value.value)
        return Value(f"(-{value.code})", value.type)

    def of_BinOp(self, node: ast.BinOp) -> Value:
        """Arithmetic; `/` is of floats."""
        a, b = self.expression(node.left), self.expression(node.right)
        if a.known and b.known and not isinstance(node.op, ast.Mod):
            return constant(
                eval(
                    compile(ast.Expression(_with(node, a.value, b.value)), "", "eval"),
                    {},
                )
            )
        if isinstance(node.op, ast.BitAnd):
            return Value(f"({as_type(a, BOOL)} && {as_type(b, BOOL)})", BOOL)
        both = a.type == INT and b.type == INT and not isinstance(node.op, ast.Div)
        kind = INT if both else FLOAT
        code = f"({as_type(a, kind)} {BINARY[type(node.op)]} {as_type(b, kind)})"
        return Value(code, kind)

    def of_Compare(self, node: ast.Compare) -> Value:
        """Comparisons, chained ones too."""
        values = [self.expression(n) for n in (node.left, *node.comparators)]
        if all(v.known for v in values):
            tree = ast.Compare(
                ast.Constant(values[0].value), node.ops, [ast.Constant(v.value) for v in values[1:]]
            )
            whole_tree = ast.fix_missing_locations(ast.Expression(tree))
            return constant(bool(eval(compile(whole_tree, "", "eval"), {})))
        parts = []
        for a, operation, b in zip(values, node.ops, values[1:], strict=False):
            kind = a.type if a.type == b.type else FLOAT
            parts.append(f"{as_type(a, kind)} {COMPARE[type(operation)]} {as_type(b, kind)}")
        return Value("(" + " && ".join(parts) + ")", BOOL)

    def of_BoolOp(self, node: ast.BoolOp) -> Value:
        """`and`, `or`; what is known drops out."""
        conjunction = isinstance(node.op, ast.And)
        values = [self.expression(v) for v in node.values]
        if any(v.known and bool(v.value) != conjunction for v in values):
            return constant(not conjunction)
        unknown = [as_type(v, BOOL) for v in values if not v.known]
        if not unknown:
            return constant(conjunction)
        return Value("(" + (" && " if conjunction else " || ").join(unknown) + ")", BOOL)

    def of_IfExp(self, node: ast.IfExp) -> Value:
        """A choice between two values."""
        test = self.expression(node.test)
        if test.known:
            return self.expression(node.body if test.value else node.orelse)
        return self.chosen(test, self.expression(node.body), self.expression(node.orelse))

    def chosen(self, test: Value, a: Value, b: Value) -> Value:
        """`test ? a : b`."""
        kind = a.type if a.type == b.type else FLOAT
        condition, yes, no = as_type(test, BOOL), as_type(a, kind), as_type(b, kind)
        # Without a branch, which a compiler of shaders would make of `? :`; but tables are read,
        # and functions called, only where their values are needed.
        if kind == FLOAT and not _CALL.search(yes + no):
            return Value(f"mix({no}, {yes}, {condition})", kind)
        return Value(f"({condition} ? {yes} : {no})", kind)

    def of_Tuple(self, node: ast.Tuple) -> Value:
        """Several values, as a struct."""
        values = [self.expression(e) for e in node.elts]
        kind = Several(tuple(v.type for v in values))
        name = self.translation.glsl_type(kind)
        return Value(f"{name}({', '.join(v.code for v in values)})", kind)

    def parts(self, node: ast.expr, count: int) -> list[Value]:
        """The values of a tuple, however it comes about."""
        if isinstance(node, ast.Tuple):
            return [self.expression(e) for e in node.elts]
        if isinstance(node, ast.IfExp):
            test = self.expression(node.test)
            if test.known:
                return self.parts(node.body if test.value else node.orelse, count)
            both = zip(self.parts(node.body, count), self.parts(node.orelse, count), strict=True)
            return [self.chosen(test, a, b) for a, b in both]
        value = self.expression(node)
        if isinstance(value.type, Shape):
            return [Value(_side(value.type.table, k), INT) for k in range(count)]
        return self.split(self.held(value))

    def split(self, value: Value) -> list[Value]:
        """The members of a tuple in a variable."""
        if not isinstance(value.type, Several):
            raise NotImplementedError(f"{value} has no members")
        return [Value(f"{value.code}.m{k}_", t) for k, t in enumerate(value.type.types)]

    def of_Call(self, node: ast.Call) -> Value:
        """A conversion, a function of GLSL, a struct, or another kernel."""
        if isinstance(node.func, ast.Attribute) and node.func.attr == "view":
            return Value(f"intBitsToFloat({self.expression(node.func.value).code})", FLOAT)
        if isinstance(node.func, ast.Name) and node.func.id in self.known:
            # `R(x)`: all reals are of the one precision.
            return self._converted(FLOAT, self.expression(node.args[0]))
        function = self.object(node.func)
        if function is None:
            raise NotImplementedError(ast.unparse(node))
        values = [self.expression(a) for a in node.args]
        if function in INTS or function in FLOATS:
            return self._converted(INT if function in INTS else FLOAT, values[0])
        if function in (min, max, abs) or function in MATH:
            return self._of_glsl(function, values)
        if function is math.copysign:
            a, b = (as_type(v, FLOAT) for v in values)
            return Value(f"mix(abs({a}), -abs({a}), {b} < 0.0)", FLOAT)
        if function is index:
            return Value(f"({as_type(values[0], INT)} + {as_type(values[1], INT)})", INT)
        if function is whole:
            return values[0]
        if isinstance(function, type) and hasattr(function, "_fields"):
            return self._struct(function, values)
        found: Value = self.translation.call(function, values)
        return found

    def _converted(self, kind: str, value: Value) -> Value:
        if value.known:
            return constant(float(value.value) if kind == FLOAT else int(value.value))
        return Value(as_type(value, kind), kind)

    def _of_glsl(self, function: Any, values: list[Value]) -> Value:
        if function in MATH:
            return Value(f"{MATH[function]}({as_type(values[0], FLOAT)})", FLOAT)
        kind = INT if all(v.type == INT for v in values) else FLOAT
        codes = [as_type(v, kind) for v in values]
        if function is abs:
            return Value(f"abs({codes[0]})", kind)
        code = codes[0]
        for other in codes[1:]:
            code = f"{function.__name__}({code}, {other})"
        return Value(code, kind)

    def _struct(self, kind: Any, values: list[Value]) -> Value:
        name = self.translation.struct(kind, tuple(v.type for v in values))
        _, fields = self.translation.structs[kind]
        codes = [as_type(v, t) for v, (_, t) in zip(values, fields, strict=True)]
        return Value(f"{name}({', '.join(codes)})", kind)


def _side(table: Table, k: int) -> str:
    return f"{table.name}_n{k}"


def _with(node: ast.BinOp, a: Any, b: Any) -> ast.expr:
    tree = ast.BinOp(ast.Constant(a), node.op, ast.Constant(b))
    return ast.fix_missing_locations(tree)

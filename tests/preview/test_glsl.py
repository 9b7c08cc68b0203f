"""Kernels as GLSL: what the translation does with each thing that Python says otherwise."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from fabricusd.preview.glsl.kernels import LAWS, ROOTS, shader
from fabricusd.preview.glsl.tables import NUMBERS, TABLES, glsl_name
from fabricusd.preview.glsl.translate import Translation
from fabricusd.preview.glsl.values import BOOL, FLOAT, INT, REAL, Group, Table, Value, constant

FIELDS = {
    "tables.rows": Value("", Table("tables_rows", 2, FLOAT)),
    "tables.count": Value("tables_count", INT),
}
GIVEN = {
    "f": Value("", FLOAT), "i": Value("", INT), "b": Value("", BOOL), "R": Value("", REAL),
    "T": Value("", Group("tables")), "yes": constant(True), "no": constant(False),
}  # fmt: skip


def translated(kernel, types: str) -> str:
    """The GLSL of a kernel, on one line."""

    def choose(*_):
        raise NotImplementedError

    made = Translation(FIELDS, {}, choose)
    made.call(kernel, [GIVEN[t] for t in types.split()])
    return re.sub(r"\s+", " ", "\n".join(made.text))


def swapped(R, x, y):
    x, y = y, x
    return x - y


def counted(R, x):
    n = 0
    for k in range(4):
        n += k
    n = n + x
    return n


def looked_up(R, tables, k):
    row = tables.rows[k]
    total = R(0)
    for c in range(tables.rows.shape[1]):
        total += row[c]
    return total / tables.count


def branched(R, x, deep):
    if deep:
        return math.sqrt(x)
    return x


def ordered(R, x, y):
    low, high = (x, y) if x < y else (y, x)
    return low, high


def ordered_twice(R, x, y):
    a, b = ordered(R, x, y)
    return a + R(2) * b


def clamped(R, x):
    return min(max(x, R(-1)), R(1)) if -2 < x <= 2 else np.floor(x)


def tried(R, x):
    try:
        return x
    finally:
        pass


def test_a_swap_goes_through_variables():
    assert "t1 = y; t2 = x; x = t1; y = t2; return (x - y);" in translated(swapped, "R f f")


def test_a_count_that_gets_a_real_is_a_real_from_the_start():
    text = translated(counted, "R f")
    assert "float n;" in text
    assert "n = 0.0;" in text
    assert "n = (n + float(k));" in text


def test_tables_are_read_by_offset_and_row():
    text = translated(looked_up, "R T i")
    assert "c < tables_rows_n1" in text
    assert "F(tables_rows_at + (row) * tables_rows_n1 + c)" in text
    assert "(total / float(tables_count))" in text


@pytest.mark.parametrize(("deep", "body"), [("yes", "return sqrt(x);"), ("no", "return x;")])
def test_of_a_branch_that_is_known_only_what_is_taken_is_there(deep, body):
    text = translated(branched, f"R f {deep}")
    assert text.startswith("float k_branched(float x)")
    assert body in text
    assert "if" not in text


def test_a_branch_that_is_not_known_stays():
    assert "if (deep)" in translated(branched, "R f b")


def test_tuples_are_structs():
    text = translated(ordered_twice, "R f f")
    assert "struct T_ff { float m0_; float m1_; };" in text
    assert "mix(y, x, (x < y))" in text
    assert "t1 = k_ordered(x, y); a = t1.m0_; b = t1.m1_;" in text


def test_comparisons_chain_and_minima_nest():
    text = translated(clamped, "R f")
    assert "(-2.0 < x && x <= 2.0)" in text or "(float(-2) < x && x <= 2.0)" in text
    assert "min(max(x, -1.0), 1.0)" in text
    assert "floor(x)" in text


def test_what_is_not_understood_is_not_translated():
    with pytest.raises(NotImplementedError, match="tried"):
        translated(tried, "R f")


def test_the_shader_declares_all_tables_and_has_all_kernels():
    text = shader()
    for name in TABLES:
        assert f"#define {glsl_name(name)}_at shapes[" in text
    for name in NUMBERS:
        assert f"#define {glsl_name(name)} " in text
    for kernel, _ in ROOTS:
        assert re.search(rf"^\w+ k_{kernel.__name__}\(", text, re.M)
    for law in LAWS:
        assert f"LAW == {law.upper()}" in text
    # All horizons of groups are read by fours, the only way in which their texture can be read.
    assert text.count("shadow_mean_at") == 2
    # Nodes are points: the error functions are those of the profile across a thread.
    assert len(re.findall(r"k_erf32\(", text)) == 5


def larger(R, x, y):
    return x if x > y else y


def entry_or(R, tables, k, x):
    return tables.rows[k, 0] if x > R(0) else x


def test_a_choice_of_numbers_is_no_branch():
    # A compiler in software took minutes for the branches of level `thread`.
    text = translated(larger, "R f f")
    assert "mix(y, x, (x > y))" in text
    assert "?" not in text


def test_a_table_is_read_only_where_its_value_is_needed():
    assert "? F(tables_rows_at" in translated(entry_or, "R T i f")

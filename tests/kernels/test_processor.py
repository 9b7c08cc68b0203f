"""The level of x86-64 that kernels are compiled for."""

from __future__ import annotations

import os
import subprocess
import sys

import llvmlite.binding as llvm
import numba
import pytest

from fabricusd.kernels.processor import LEVELS, level_of

V4, V3 = LEVELS
FEATURES = {level.name: ",".join(f"+{name}" for name in sorted(level.needs)) for level in LEVELS}


@pytest.mark.parametrize(
    ("features", "level"),
    [
        (FEATURES["x86-64-v4"], V4),
        (FEATURES["x86-64-v3"], V3),
        (f"{FEATURES['x86-64-v3']},+avx512f", V3),
        (FEATURES["x86-64-v4"].replace("+avx512bw", "-avx512bw"), V3),
        (FEATURES["x86-64-v3"].replace("+fma", "-fma"), None),
        ("+neon", None),
        ("", None),
    ],
)
def test_a_processor_has_the_best_level_of_which_it_has_everything(features, level):
    assert level_of(features) == level


@pytest.mark.parametrize("level", LEVELS)
def test_llvm_knows_the_level(level):
    if not llvm.get_process_triple().startswith("x86_64"):
        pytest.skip("for x86-64 only")
    # LLVM names a level that it does not know on stderr, and compiles for an old processor.
    script = (
        "import numba\n"
        "f = numba.njit(lambda x: x + 1)\n"
        "f.compile('int64(int64)')\n"
        "print(f.targetctx.codegen().magic_tuple())"
    )
    chosen = {"NUMBA_CPU_NAME": level.name, "NUMBA_CPU_FEATURES": level.features}
    done = subprocess.run(
        [sys.executable, "-c", script], env={**os.environ, **chosen}, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    assert level.name in done.stdout
    assert "not a recognized" not in done.stderr


@pytest.mark.parametrize(
    ("variable", "chosen"), [("NUMBA_CPU_NAME", "haswell"), ("NUMBA_CPU_FEATURES", "+sse2")]
)
def test_what_the_user_chose_stays(variable, chosen):
    script = (
        "from types import SimpleNamespace\n"
        "import llvmlite.binding as llvm\n"
        f"features = {FEATURES['x86-64-v4']!r}\n"
        "llvm.get_host_cpu_features = lambda: SimpleNamespace(flatten=lambda: features)\n"
        "import fabricusd.kernels, numba\n"
        "print(numba.config.CPU_NAME, numba.config.CPU_FEATURES)"
    )
    clean = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_CPU")}
    ours, theirs = (
        subprocess.run(
            [sys.executable, "-c", script], env=environment, check=True, capture_output=True,
            text=True,
        ).stdout.split()
        for environment in (clean, {**clean, variable: chosen})
    )  # fmt: skip
    assert ours == ["x86-64-v4", "-prefer-256-bit"]
    assert chosen in theirs
    assert "x86-64-v4" not in theirs


def test_this_process_compiles_for_the_level_of_its_processor():
    if any(name.startswith("NUMBA_CPU") for name in os.environ):
        pytest.skip("chosen otherwise")
    level = level_of(llvm.get_host_cpu_features().flatten())
    assert numba.config.CPU_NAME == (level and level.name)

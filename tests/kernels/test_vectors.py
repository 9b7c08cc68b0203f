"""The width of vectors that LLVM may use."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from fabricusd.kernels import vectors

FEATURES = "+avx2,+avx512f,-avx512er"


@pytest.mark.parametrize("name", sorted(vectors.KEPT_NARROW))
def test_llvm_is_told_not_to_keep_to_256_bits(name):
    assert vectors.widened(name, FEATURES) == f"{FEATURES},-prefer-256-bit"


@pytest.mark.parametrize(
    ("name", "features"),
    [("znver5", FEATURES), ("haswell", "+avx2"), ("cascadelake", "+avx2,-avx512f"), ("", "")],
)
def test_other_processors_are_left_alone(name, features):
    assert vectors.widened(name, features) is None


@pytest.mark.parametrize(
    ("variable", "chosen", "kept"),
    [("NUMBA_CPU_NAME", "haswell", "None"), ("NUMBA_CPU_FEATURES", "+sse2", "+sse2")],
)
def test_what_the_user_chose_stays(variable, chosen, kept):
    script = (
        "from types import SimpleNamespace\n"
        "import llvmlite.binding as llvm\n"
        "llvm.get_host_cpu_name = lambda: 'cascadelake'\n"
        "llvm.get_host_cpu_features = lambda: SimpleNamespace(flatten=lambda: '+avx512f')\n"
        "import fabricusd.kernels, numba\n"
        "print(numba.config.CPU_FEATURES)"
    )
    clean = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_CPU")}
    found = [
        subprocess.run(
            [sys.executable, "-c", script], env=environment, check=True, capture_output=True,
            text=True,
        ).stdout.strip()
        for environment in (clean, {**clean, variable: chosen})
    ]  # fmt: skip
    assert found == ["+avx512f,-prefer-256-bit", kept]

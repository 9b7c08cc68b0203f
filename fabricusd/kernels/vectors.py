"""Let LLVM use vectors of 512 bits on processors where they were measured to be faster.

LLVM has AVX-512 but keeps to 256 bits on the processors below, to spare other programs the lower
clock that wide vectors cost on the first of them. Kernels here are loops of arithmetic and little
else. Decision 027 has the figures.
"""

from __future__ import annotations

import llvmlite.binding as llvm
import numba

KEPT_NARROW = frozenset({
    "skylake-avx512", "cascadelake", "cooperlake", "cannonlake", "icelake-client", "icelake-server",
    "tigerlake", "rocketlake", "sapphirerapids", "emeraldrapids", "graniterapids",
    "graniterapids-d",
})  # fmt: skip
"""LLVM's names of processors for which it prefers vectors of 256 bits to those of 512."""


def widened(name: str, features: str) -> str | None:
    """The features to compile with on processor `name`, which has `features`; None for LLVM's own
    choice."""
    if name not in KEPT_NARROW or "+avx512f" not in features.split(","):
        return None
    return f"{features},-prefer-256-bit"


def use_wide_vectors() -> None:
    """Choose the width, unless NUMBA_CPU_NAME or NUMBA_CPU_FEATURES already does."""
    if numba.config.CPU_NAME is not None or numba.config.CPU_FEATURES is not None:
        return
    features = widened(llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
    if features is not None:
        numba.config.CPU_FEATURES = features

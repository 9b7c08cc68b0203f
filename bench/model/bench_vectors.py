"""What the width of vectors brings: rates of the surface law, compiled for several processors.

    python bench/model/bench_vectors.py [--presets linen_plain silk_shot]

Runs `bench_surface` in processes of their own, with an empty cache of kernels each: as this machine
compiles, for the processor by name, for each level that it has, and kept to 256 bits and to AVX2.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import llvmlite.binding as llvm

from fabricusd.samples.kernels import levels

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]


def settings() -> dict[str, tuple[str, str]]:
    """(NUMBA_CPU_NAME, NUMBA_CPU_FEATURES) by what they stand for; without a name, both are left
    alone."""
    name, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    found = {"as fabricusd chooses": ("", ""), "this processor": (name, features)}
    for level in levels():
        found[level.name] = (level.name, level.features)
        if "-prefer-256-bit" in level.features:
            found[f"{level.name}, kept to 256 bits"] = (level.name, "+prefer-256-bit")
    if levels():
        found["haswell"] = ("haswell", "")
    return found


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presets", nargs="+", default=["linen_plain", "silk_shot"])
    options = parser.parse_args()
    print(f"{llvm.get_host_cpu_name()}, load {os.getloadavg()[0]:.1f}")
    lines = "\n".join(f"bench_surface.measure({name!r}, 300_000, 7)" for name in options.presets)
    code = f"import bench_surface, numba\nnumba.set_num_threads(1)\n{lines}"
    for said, (name, features) in settings().items():
        chosen = {"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": features}
        with tempfile.TemporaryDirectory() as kernels:
            environment = {
                **{k: v for k, v in os.environ.items() if k not in chosen},
                **(chosen if name else {}),
                "PYTHONPATH": os.pathsep.join((str(ROOT), str(HERE))),
                "NUMBA_CACHE_DIR": kernels,
            }
            print(said, flush=True)
            subprocess.run([sys.executable, "-c", code], env=environment, check=True)


if __name__ == "__main__":
    main()

"""The weave grid as `uchar[]` compared with one string per row; see docs/decisions/001.

python bench/bake/bench_rows.py
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from pxr import Sdf, Vt

SIZE = 4096
READ = """
import resource, sys, time
start = time.perf_counter()
from pxr import Usd
import numpy as np
stage = Usd.Stage.Open(sys.argv[1])
value = stage.GetPrimAtPath("/F").GetAttribute("grid").Get()
if sys.argv[2] == "string[]":
    value = np.frombuffer("".join(value).encode(), np.uint8)
assert np.asarray(value).size == int(sys.argv[3])
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(f"read {time.perf_counter() - start:.2f} s, peak {peak:.0f} MB")
"""


def main() -> None:
    """Write each form, read it in a new process, and print a line."""
    grid = (np.random.default_rng(0).random((SIZE, SIZE)) < 0.5).astype(np.uint8)
    rows = [(row + ord("0")).tobytes().decode("ascii") for row in grid]
    forms = {
        "uchar[]": Vt.UCharArray.FromNumpy(grid.reshape(-1)),
        "string[]": Vt.StringArray(rows),
    }
    with tempfile.TemporaryDirectory() as name:
        for suffix in (".usda", ".usdc"):
            for kind, value in forms.items():
                path = Path(name) / f"{kind[:-2]}{suffix}"
                layer = Sdf.Layer.CreateNew(str(path))
                prim = Sdf.CreatePrimInLayer(layer, "/F")
                prim.specifier = Sdf.SpecifierDef
                Sdf.AttributeSpec(prim, "grid", Sdf.ValueTypeNames.Find(kind)).default = value
                layer.Save()
                done = subprocess.run(
                    [sys.executable, "-c", READ, str(path), kind, str(SIZE * SIZE)],
                    stdout=subprocess.PIPE, text=True, check=True,
                )  # fmt: skip
                size = path.stat().st_size / 1e6
                print(f"{kind:9} {suffix}  {size:5.1f} MB  {done.stdout.strip()}")


if __name__ == "__main__":
    main()

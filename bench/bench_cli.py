"""Whole commands as processes: seconds and peak memory, median of five.

    python bench/bench_cli.py

A 4096 by 4096 jacquard as .usda, .usdc, .wif and .png; every run starts a new Python.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from fabricusd.fabric import Fabric, Weave
from fabricusd.images.files import write_png
from fabricusd.schema import save
from fabricusd.weaves import from_fabric, wif_text

RUNS = 5
SIZE = 4096


def measure(*arguments: str) -> tuple[float, float]:
    """(seconds, MB): medians over RUNS processes."""
    seconds, megabytes = [], []
    for _ in range(RUNS):
        start = time.perf_counter()
        process = subprocess.Popen(
            [sys.executable, "-m", "fabricusd", *arguments],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        _, status, usage = os.wait4(process.pid, 0)
        seconds.append(time.perf_counter() - start)
        megabytes.append(usage.ru_maxrss / 1024)
        if os.waitstatus_to_exitcode(status):
            raise SystemExit(f"{arguments} failed")
    return statistics.median(seconds), statistics.median(megabytes)


def make(folder: Path) -> None:
    """The jacquard in each form."""
    rng = np.random.default_rng(1)
    # Runs of four: as hard to compress as a figured cloth, with real floats.
    cells = np.repeat(rng.random((SIZE, SIZE // 4)) < 0.5, 4, axis=1)
    jacquard = Fabric(name="Jacquard", weave=Weave(cells, "jacquard"))
    for suffix in (".usda", ".usdc"):
        save(jacquard, folder / f"jacquard{suffix}")
    (folder / "jacquard.wif").write_text(wif_text(from_fabric(jacquard)))
    write_png(folder / "jacquard.png", np.where(cells.T[::-1, :, None], 0, 255).astype(np.uint8))


def main() -> None:
    """Print a table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # A child's peak counts what its parent had at the fork, so the parent stays small.
        subprocess.run([sys.executable, __file__, "--make", name], check=True)
        print(f"{'command':40} {'seconds':>8} {'MB':>6}")
        rows = [("--help",)]
        for suffix in (".usda", ".usdc"):
            made = str(folder / f"made{suffix}")
            rows += [("new", "--image", str(folder / "jacquard.png"), "-o", made)]
        for suffix in (".usda", ".usdc", ".wif", ".png"):
            rows += [("cat", str(folder / f"jacquard{suffix}"))]
            rows += [("check", str(folder / f"jacquard{suffix}"))]
        for arguments in rows:
            seconds, megabytes = measure(*arguments)
            words = " ".join(Path(a).name for a in arguments)
            print(f"{words:40} {seconds:8.2f} {megabytes:6.0f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--make"]:
        make(Path(sys.argv[2]))
    else:
        main()

"""Wall time and processor time of the first picture on a machine, and of later ones.

    python bench/tracer/bench_first.py [--runs 5] [--size 256] [--spp 4]

Runs `fabricusd render` on the draped cloth of `samples`: first with an empty cache, as after an
installation from source, then with the cache that this run filled, and once more with an empty
cache at level `weave`, as for a close-up, which needs more kernels. Where the package brings
compiled kernels (`make wheel`), it then takes both first pictures with them, as after the
installation of a wheel. Processor time is that of the command and all processes that it started.
The first figures are valid only with two idle processors; the load is printed beside them.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from fabricusd.kernels.ready import FOLDER, VARIABLE, file_name

ROOT = Path(__file__).resolve().parents[2]


def run(
    scene: Path, size: int, spp: int, cache: Path, level: str = "auto", ready: bool = False
) -> tuple[float, float]:
    """(wall time, processor time) [s] of one picture, with the cache in a folder.

    ready : whether kernels that the package brings are used
    """
    command = [
        sys.executable, "-m", "fabricusd", "render", str(scene), "-o", f"{scene}.exr",
        "--width", str(size), "--height", str(size), "--spp", str(spp), "-q",
        "--level", level,
    ]  # fmt: skip
    environment = {
        **os.environ, "FABRICUSD_CACHE_DIR": str(cache), VARIABLE: "1" if ready else "0",
        "PYTHONPATH": str(ROOT),
    }  # fmt: skip
    environment.pop("NUMBA_CACHE_DIR", None)
    # Let Python cache its modules, as an installer would.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.perf_counter()
    subprocess.run(command, check=True, env=environment)
    wall = time.perf_counter() - begun
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    busy = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return wall, busy


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5, help="of the next pictures")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--spp", type=int, default=4)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # Make the scene in a subprocess, before the children of this process are measured.
        make = f"import sys; sys.path.insert(0, {str(ROOT / 'samples')!r})\n"
        make += "from pathlib import Path; from make_samples import make_drape\n"
        make += f"make_drape(Path({name!r}))"
        subprocess.run(
            [sys.executable, "-c", make], check=True, env={**os.environ, "PYTHONPATH": str(ROOT)}
        )
        scene = folder / "drape.usda"
        print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}")
        wall, busy = run(scene, options.size, options.spp, folder / "cache")
        print(f"first picture: {wall:.1f} s, processors {busy:.1f} s")
        times = [
            run(scene, options.size, options.spp, folder / "cache") for _ in range(options.runs)
        ]
        wall, busy = (statistics.median(column) for column in zip(*times, strict=True))
        print(f"next pictures, median of {options.runs}: {wall:.2f} s, processors {busy:.2f} s")
        wall, busy = run(scene, options.size, options.spp, folder / "others", level="weave")
        print(f"first picture, level weave: {wall:.1f} s, processors {busy:.1f} s")
        if (FOLDER / file_name()).exists():
            for level in ("auto", "weave"):
                name = folder / f"ready {level}"
                wall, busy = run(scene, options.size, options.spp, name, level, ready=True)
                said = f"first picture with the package's kernels, level {level}"
                print(f"{said}: {wall:.1f} s, processors {busy:.1f} s")
        print(f"load {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()

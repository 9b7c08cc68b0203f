"""What a thread's law costs a picture: `conserving` beside the published one, and their noise.

    python bench/tracer/bench_laws.py [--preset silk_shot] [--size 384] [--spp 32] [--runs 5]

Renders the draped cloth of `samples` with both appearances of a preset, in turns, in processes of
their own, with kernels and tables in the cache. Prints the medians of the processor time of all
workers, whole and without what a picture of one sample takes, and their ratio, with the processor's
name and the load.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from unittest import mock

import llvmlite.binding

ROOT = Path(__file__).resolve().parents[2]
LAWS = "published", "conserving"


def seconds(scene: Path, size: int, spp: int) -> float:
    """Processor time [s] of one picture."""
    command = [
        sys.executable, "-m", "fabricusd", "render", str(scene), "-o", f"{scene}.exr", "-q",
        "--width", str(size), "--height", str(size), "--spp", str(spp), "--workers", "2",
    ]  # fmt: skip
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, env={**os.environ, "PYTHONPATH": str(ROOT)})
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def scenes(folder: Path, preset: str) -> dict[str, Path]:
    """The drape in each appearance."""
    sys.path.insert(0, str(ROOT / "samples"))
    import make_samples

    found = {}
    dress = make_samples.dress
    for law in LAWS:
        (folder / law).mkdir()

        def dressed(stage: object, prim: object, _: str, law: str = law) -> object:
            return dress(stage, prim, f"{preset}{{appearance={law}}}")

        with mock.patch.object(make_samples, "dress", dressed):
            found[law] = make_samples.make_drape(folder / law)
    return found


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--preset", default="silk_shot")
    parser.add_argument("--size", type=int, default=384)
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        found = scenes(Path(name), options.preset)
        times: dict[tuple[str, int], list[float]] = {}
        for run in range(options.runs + 1):
            for law, scene in found.items():
                for spp in (1, options.spp):
                    taken = seconds(scene, options.size, spp)
                    if run:
                        times.setdefault((law, spp), []).append(taken)
    whole = {law: statistics.median(times[law, options.spp]) for law in LAWS}
    begun = {law: statistics.median(times[law, 1]) for law in LAWS}
    processor = f"{platform.machine()} {llvmlite.binding.get_host_cpu_name()}"
    print(f"{processor}, load {os.getloadavg()[0]:.1f}")
    for law in LAWS:
        print(f"{law:10s} {whole[law]:6.2f} s, {whole[law] - begun[law]:6.2f} s of them sampling")
    a, b = LAWS
    sampling = (whole[b] - begun[b]) / (whole[a] - begun[a])
    print(f"ratio {whole[b] / whole[a]:.2f}, of sampling {sampling:.2f}")


if __name__ == "__main__":
    main()

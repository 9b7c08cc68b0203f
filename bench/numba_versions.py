"""Which versions of numba fabricusd works with: one virtual environment for each, and a table.

    python bench/numba_versions.py [--versions 0.60.0 0.68.1] [--folder DIR] [--plain]

Each environment gets what pyproject.toml asks for, with the one version of numba in place of its
range. The quick tests of `kernels`, one chi-squared test of the sampler, and one picture at level
`far` run in it, with numba's internals in use (see `kernels/internals.py`), or, with --plain,
without them. The last column is the largest difference of that picture from the one that
the first version made, over the mean. The table goes to stdout as Markdown, row by row.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fabricusd.images.files import read_exr_layers
from fabricusd.kernels.internals import VARIABLE

ROOT = Path(__file__).resolve().parents[1]
VERSIONS = (
    "0.60.0", "0.61.2", "0.62.1", "0.63.1", "0.64.0", "0.65.1", "0.66.0", "0.67.0", "0.68.1",
)  # fmt: skip
"""The last release of each minor version since the first that accepts numpy 2."""

CHECKS = {
    "kernels": ["tests/kernels", "-m", "not slow"],
    "sampling": [
        "tests/appearance/sampling/test_mixture.py",
        "-k", "test_samples_follow_the_density and silk_shot and microcylinder and far",
    ],
}  # fmt: skip
"""Column of the table -> arguments of pytest."""

SCENE = "tests/cases/obj_centimetres/panel_cm.obj"
FABRIC = "silk_shot"


class Outcome(NamedTuple):
    """How a command ended, and what it printed last."""

    good: bool
    words: str


def install(folder: Path, version: str) -> Path:
    """The Python of an environment in `folder` with that numba; made where it is missing."""
    python = folder / version / "bin" / "python"
    done = folder / version / ".installed"
    if not done.exists():
        subprocess.run([sys.executable, "-m", "venv", str(folder / version)], check=True)
        project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
        others = [need for need in project["dependencies"] if not need.startswith("numba")]
        wanted = [*others, f"numba=={version}", "pytest", "hypothesis"]
        subprocess.run(
            [
                str(python),
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
                *wanted,
            ],
            check=True,
        )
        done.touch()
    return python


def run(python: Path, arguments: list[str], cache: Path, plain: bool) -> Outcome:
    """A module of Python, run on the checkout with a kernel cache of its own."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "FABRICUSD_CACHE_DIR": str(cache),
        VARIABLE: "1" if plain else "0",
    }
    done = subprocess.run(
        [str(python), "-m", *arguments], cwd=ROOT, env=environment, capture_output=True, text=True
    )
    if done.returncode:
        # What failed, for whoever asks why.
        print(done.stdout[-6000:], done.stderr[-3000:], file=sys.stderr)
    counts = re.findall(r"\d+ (?:passed|failed|skipped|errors?)", done.stdout)
    return Outcome(done.returncode == 0, ", ".join(counts))


def numpy_of(python: Path) -> str:
    """The version of numpy in an environment."""
    code = "import numpy; print(numpy.__version__)"
    return subprocess.run(
        [str(python), "-c", code], check=True, capture_output=True, text=True
    ).stdout.strip()


def main() -> None:
    """Print the table; status 1 where anything failed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--versions", nargs="+", default=VERSIONS, metavar="X.Y.Z")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "numbas")
    parser.add_argument("--plain", action="store_true", help="without numba's internals")
    options = parser.parse_args()
    print("| numba | numpy | kernels | sampling | `far` picture |\n|---|---|---|---|---|")
    first: np.ndarray | None = None
    all_good = True
    for version in options.versions:
        python = install(options.folder, version)
        cache = options.folder / f"cache-{version}"
        cells = []
        for arguments in CHECKS.values():
            words = ["pytest", "-q", "-p", "no:cacheprovider", *arguments]
            outcome = run(python, words, cache, options.plain)
            all_good &= outcome.good
            cells.append(outcome.words or "did not start")
        picture = options.folder / f"far-{version}{'-plain' * options.plain}.exr"
        command = ["fabricusd", "render", SCENE, "--fabric", FABRIC, "-o", str(picture)]
        command += ["--level", "far", "--width", "64", "--height", "64", "--spp", "8", "-q"]
        drawn = run(python, command, cache, options.plain)
        all_good &= drawn.good
        if drawn.good:
            pixels = read_exr_layers(picture)[0]["beauty"][..., :3]
            first = pixels if first is None else first
            cells.append(f"{np.abs(pixels - first).max() / first.mean():.1e}")
        else:
            cells.append("failed")
        print(f"| {version} | {numpy_of(python)} | {' | '.join(cells)} |", flush=True)
    raise SystemExit(0 if all_good else 1)


if __name__ == "__main__":
    main()

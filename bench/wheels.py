"""Ask which dependencies have wheels for other systems; prints the table of docs/platforms.md.

    python bench/wheels.py

Asks pip for each package by itself, as it is configured on this machine. Installs nothing.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import tomllib
from datetime import date
from pathlib import Path

ROOT = Path(__file__).parents[1]

SYSTEMS = {
    "Linux x86-64": ["manylinux_2_28_x86_64", "manylinux2014_x86_64", "manylinux_2_27_x86_64"],
    "Windows x86-64": ["win_amd64"],
    "macOS arm64": [f"macosx_{k}_0_arm64" for k in range(11, 16)]
    + [f"macosx_{k}_0_universal2" for k in range(11, 16)]
    + ["macosx_10_9_universal2"],
}
"""Tags of wheels that each system takes."""

EXTRAS = ("usd", "denoise", "gltf", "distributed", "raw", "mitsuba")
INDIRECT = ("llvmlite",)


def packages() -> dict[str, str]:
    """Requirement, and the extra it belongs to."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    found = dict.fromkeys((*project["dependencies"], *INDIRECT), "")
    for extra in EXTRAS:
        found |= dict.fromkeys(project["optional-dependencies"][extra], extra)
    return found


def wheel(requirement: str, tags: list[str]) -> str:
    """The version of the newest wheel for Python 3.11, or nothing."""
    with tempfile.TemporaryDirectory() as folder:
        run = [sys.executable, "-m", "pip", "download", requirement, "--quiet", "--no-deps",
               "--only-binary=:all:", "--python-version", "3.11", "--dest", folder,
               *(word for tag in tags for word in ("--platform", tag))]  # fmt: skip
        done = subprocess.run(run, capture_output=True, text=True)
        names = [path.name for path in Path(folder).iterdir()]
    if done.returncode or not names:
        return "none"
    version = names[0].split("-")[1]
    return f"{version} (any)" if names[0].endswith("-none-any.whl") else version


def main() -> None:
    """Print the table."""
    print(f"{date.today():%Y-%m-%d}, Python 3.11\n")
    print(f"| package | extra | {' | '.join(SYSTEMS)} |\n|---|---|{'---|' * len(SYSTEMS)}")
    for requirement, extra in packages().items():
        found = " | ".join(wheel(requirement, tags) for tags in SYSTEMS.values())
        print(f"| `{requirement}` | {extra} | {found} |", flush=True)


if __name__ == "__main__":
    main()

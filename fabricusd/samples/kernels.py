"""Compile what the commands need, once for each level of processor, into one file."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

import llvmlite.binding as llvm
import numba

from fabricusd.cache import KERNELS, VARIABLE
from fabricusd.errors import FabricError
from fabricusd.files import whole_file
from fabricusd.kernels.cache import fingerprint
from fabricusd.kernels.processor import LEVELS, Level, level_of
from fabricusd.kernels.ready import VARIABLE as READY
from fabricusd.kernels.ready import pack

SMALL = "--width 32 --height 32 --spp 2 -q"

COMMANDS = (
    "samples .",
    *(f"dress skirt.obj --units cm --fabric {name} -o {name}.usda"
      for name in ("linen_plain", "denim", "velvet", "polyester_satin_charmeuse")),
    f"render linen_plain.usda -o o.exr {SMALL} --aov all",
    *(f"render {name}.usda -o o.exr {SMALL} --level {level} --dome sky.exr"
      for name in ("linen_plain", "denim", "velvet", "polyester_satin_charmeuse")
      for level in ("far", "weave", "thread")),
    *(f"render linen_plain.usda -o o.exr {SMALL} --surface-law {law} --level {level}"
      for law in ("masked", "projected") for level in ("far", "weave")),
    *(f"preview {name} -o o.png --level {level}"
      for name in ("linen_plain", "denim") for level in ("far", "weave", "thread")),
    "bake denim.usda --fit --resolution 128 -o baked -q",
    "bake linen_plain.usda --fit --resolution 1024 -o baked_near -q",
)  # fmt: skip
"""The commands of a first day, small; each is run in one folder, in this order."""


def levels() -> list[Level]:
    """The levels whose kernels this machine can run, which is a part of compiling them."""
    best = level_of(llvm.get_host_cpu_features().flatten())
    return [] if best is None else list(LEVELS[LEVELS.index(best) :])


def pack_kernels(
    file: Path,
    say: Callable[[str], None] = lambda line: None,
    commands: Iterable[str] = COMMANDS,
) -> int:
    """Write the compiled kernels of `commands` to `file`; returns how many.

    say : is called with each level and command, before it runs

    Raises `FabricError` for a processor of neither level, a numba whose kernels cannot be found
    elsewhere, a command that fails, and a file that cannot be written.
    """
    if not levels():
        raise FabricError("kernels", "are packed on processors with AVX2 only")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for level in levels():
            for command in commands:
                say(f"{level.name}: fabricusd {command}")
                _run(command, level, folder)
        kernels = folder / "cache" / KERNELS / fingerprint()
        if not kernels.is_dir():
            raise FabricError("kernels", f"of numba {numba.__version__} cannot be packed")
        try:
            with whole_file(file) as temporary:
                return pack(kernels, temporary)
        except OSError as error:
            raise FabricError(str(file), f"cannot be written: {error.strerror}") from error


def _run(command: str, level: Level, folder: Path) -> None:
    """One command, in a folder of its own and with a cache of its own."""
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    environment |= {
        VARIABLE: str(folder / "cache"), "NUMBA_CPU_NAME": level.name,
        "NUMBA_CPU_FEATURES": level.features,
        # Kernels of an earlier package would stand in for some of these.
        READY: "0",
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-m", "fabricusd", *command.split()], cwd=folder, env=environment,
        capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise FabricError(f"fabricusd {command}", f"failed: {last}")

"""A machine's first picture: half of the kernels are compiled by a second process meanwhile.

numba compiles one function at a time in a process, and keeps on disk what it compiled. While this
process compiles what paths need first, another compiles shading and what follows; when this one
gets there it finds those on disk. Whatever the other fails to make is compiled here.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from fabricusd.appearance.share_fit import AZIMUTHS, ELEVATIONS
from fabricusd.appearance.stretches import STRETCH_COLUMNS
from fabricusd.appearance.surface_sampling import SamplingTables
from fabricusd.appearance.surface_tables import surface_tables
from fabricusd.reference.departures import depart
from fabricusd.reference.far_shading import shade_far
from fabricusd.reference.film import Film
from fabricusd.reference.preview_surface import build_surfaces, shade_preview
from fabricusd.reference.scene import PreviewSurface, Scene
from fabricusd.reference.wave import Wave
from fabricusd.reference.workers import worker_count
from fabricusd.schema import load

R = np.float32
_LONGEST = 120.0
"""Seconds after which the other process is no longer waited for."""


class CompileAhead:
    """The second process, where one is needed: nothing compiled yet, and a processor free."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        # Inside another program `executable` is that program, which must not be started again.
        python = Path(sys.executable or "").name.startswith("python")
        if python and worker_count(None) > 1 and not _compiled():
            self._process = subprocess.Popen(
                [sys.executable, "-c", f"import {__name__} as ahead; ahead.compile_shading()"],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip

    def wait(self) -> None:
        """Return when shading has been compiled, or will not be."""
        process = self._process
        if process is not None:
            try:
                process.wait(_LONGEST)
            except subprocess.TimeoutExpired:
                process.kill()
            self._process = None

    def __del__(self) -> None:
        self.wait()


def _compiled() -> bool:
    """Whether numba has the cloth's kernel on disk."""
    return any(Path(shade_far.stats.cache_path).glob("far_shading.shade_far*.nbi"))


def compile_shading() -> None:
    """Compile what happens to hits after they were prepared, by sending one through it."""
    wave = Wave(16, aovs=False)
    wave.hits[:], wave.tags[:], wave.film[:] = 0, 0, 0
    tables = surface_tables(load("linen_plain"), precision=np.float32)
    none = np.zeros((ELEVATIONS, AZIMUTHS, 0), np.float32)
    lobes = SamplingTables(np.zeros((0, STRETCH_COLUMNS), np.float32), none, none)
    shade_far(R, tables, lobes, R(0), wave.hits, 0, 1)
    shade_preview(build_surfaces(Scene(materials=[PreviewSurface()])), wave.hits, wave.tags, 0, 1)
    depart(
        0, 0, 1, 1, wave.hits, wave.tags, wave.film, wave.shadow_rays, wave.shadow,
        wave.shadow_path, wave.next_rays, wave.next_lanes, wave.next_tags, np.zeros(3, np.int64),
    )  # fmt: skip
    Film(4, 4, ("beauty",)).add(np.zeros(1, np.int32), 16, wave.film)

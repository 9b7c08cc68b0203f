"""Photographs and lobes for tests: made once, and spoilt in copies."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fabricusd.appearance.thread import evaluate
from fabricusd.fabric import Thread
from fabricusd.measure import DESIGNS, Lobes, simulate
from fabricusd.measure.capture.manifest import MANIFEST
from fabricusd.measure.gantry.camera import Camera
from fabricusd.measure.gantry.simulate import Shoot

DEGREE = np.pi / 180

SPUN = Thread(
    albedo=(0.06, 0.24, 0.3), ior=1.46, isotropic=0.3, gamma_surface=12 * DEGREE,
    gamma_volume=24 * DEGREE,
)  # fmt: skip
"""Spun linen as published."""
FILAMENT = Thread(
    albedo=(0.035, 0.013, 0.0105), ior=1.539, isotropic=0.1, gamma_surface=2.5 * DEGREE,
    gamma_volume=5 * DEGREE,
)  # fmt: skip
"""Polyester filament as published."""
WIDE = Thread(
    albedo=(0.2, 0.074, 0.06), ior=1.539, isotropic=0.7, gamma_surface=30 * DEGREE,
    gamma_volume=60 * DEGREE,
)  # fmt: skip
"""Spun polyester as published, whose volume lobe is nearly isotropic."""


@cache
def _made(bits: int) -> tempfile.TemporaryDirectory[str]:
    folder = tempfile.TemporaryDirectory(prefix="shoot-")
    simulate(
        SPUN, folder.name, camera=Camera(bits=bits), shoot=Shoot(design="coarse"), name="linen",
        workers=2,
    )  # fmt: skip
    return folder


def shot(bits: int = 12) -> Path:
    """A folder of photographs of SPUN that must not be changed."""
    return Path(_made(bits).name)


def spoilt(tmp_path: Path, change: Callable[[dict[str, Any]], Any], bits: int = 12) -> Path:
    """A copy of `shot`, of links to its frames, whose manifest `change` has changed."""
    source = shot(bits)
    for frame in source.glob("*.pgm"):
        os.symlink(frame, tmp_path / frame.name)
    manifest = json.loads((source / MANIFEST).read_text())
    change(manifest)
    (tmp_path / MANIFEST).write_text(json.dumps(manifest))
    return tmp_path


def replaced(folder: Path, name: str, data: bytes) -> None:
    """A frame of a spoilt folder as other bytes."""
    (folder / name).unlink()
    (folder / name).write_bytes(data)


def lobes_of(
    thread: Thread, design: str = "slice", model: str = "microcylinder", noise: float = 0.03,
    seed: int = 0,
) -> Lobes:  # fmt: skip
    """Lobes of a thread without a gantry: `noise` of each value and a fifteenth of it per sr."""
    theta_i, theta_o, phi_d = DESIGNS[design]()
    one = np.ones((len(theta_i), 3))
    lobes = Lobes(theta_i=theta_i, theta_o=theta_o, phi_d=phi_d, f=one, sigma=one, name="made")
    f = evaluate(thread, lobes.wi, lobes.wo, model)
    sigma = np.sqrt((max(noise, 1e-4) * f) ** 2 + (max(noise, 1e-4) / 15) ** 2)
    drawn = np.random.default_rng(seed).standard_normal(f.shape) if noise else 0.0
    return Lobes(
        theta_i=theta_i, theta_o=theta_o, phi_d=phi_d, f=f + sigma * drawn, sigma=sigma,
        name="made",
    )  # fmt: skip

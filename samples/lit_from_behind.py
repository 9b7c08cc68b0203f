"""Sample scenes of cloth with the light behind it: a drape, a skirt on a figure, and a curtain.

`make_samples` writes them: `lit_drape.usda`, `lit_skirt.usda` and `curtain.usda`. Their fabrics are
presets' weaves of pale yarn whose threads conserve energy, so that light comes through them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from make_samples import (
    Grid,
    bind,
    camera,
    define_grid,
    dress,
    figure,
    grey,
    hung_skirt,
    hung_square,
    new_scene,
    rect_light,
)
from pxr import Gf, Usd, UsdGeom, UsdLux

from fabricusd.fabric import Fabric
from fabricusd.schema import load

WINDOW = 1.30, 1.50
"""Width and height of the curtain's window [m]."""
SILL = 0.75
"""Height of the window above the floor [m]."""
WALL = -0.30
"""Place of the window's wall [m]; the curtain hangs at 0."""


def pale(preset: str, name: str, albedo: tuple[float, float, float]) -> Fabric:
    """The preset's weave of one colour, whose threads conserve energy; both sides are alike."""
    fabric = load(preset)
    threads = {key: replace(t, albedo=albedo) for key, t in fabric.threads.items()}
    return replace(fabric, name=name, threads=threads, model="conserving", back=None)


def make_lit_drape(folder: Path, *, cells: int = 74, factor: int = 3, steps: int = 420) -> Path:
    """Crepe that hangs in deep folds over a narrow drum, between the camera and a lamp."""
    path = folder / "lit_drape.usda"
    stage = new_scene(path, sky=0.22, lamps=False)
    cloth = hung_square(radius=0.13, cells=cells, factor=factor, steps=steps)
    rose = pale("silk_crepe_de_chine", "crepe_rose", (0.98, 0.84, 0.80))
    dress(stage, define_grid(stage, "/World/Cloth", cloth), rose)
    rect_light(stage, "Behind", (-0.45, 0.75, -1.1), 0.5, 110.0, 4600.0)
    camera(stage, (0.2, 0.62, 1.9), (0.0, 0.21, 0.0), 85.0)
    stage.GetRootLayer().Save()
    return path


def make_lit_skirt(folder: Path, *, around: int = 120, down: int = 44, steps: int = 420) -> Path:
    """The skirt in voile on its figure, whose outline the lamp behind shows through the cloth."""
    path = folder / "lit_skirt.usda"
    stage = new_scene(path, sky=0.22, lamps=False)
    mesh = define_grid(stage, "/World/Skirt", hung_skirt(around=around, down=down, steps=steps))
    dress(stage, mesh, pale("linen_plain", "voile_white", (0.92, 0.91, 0.88)))
    figure(stage)
    rect_light(stage, "Behind", (0.25, 1.0, -1.3), 0.9, 38.0, 5000.0)
    camera(stage, (0.55, 1.05, 3.3), (0.0, 0.78, 0.0), 115.0)
    stage.GetRootLayer().Save()
    return path


def make_curtain(folder: Path, *, across: int = 720, up: int = 64) -> Path:
    """A linen curtain before a window with bars; nearly all light comes through the window."""
    path = folder / "curtain.usda"
    stage = new_scene(path, sky=0.16, lamps=False)
    stage.RemovePrim("/World/Floor")
    _room(stage)
    cloth = _pleated(across, up)
    ecru = pale("linen_plain", "linen_ecru", (0.90, 0.86, 0.76))
    dress(stage, define_grid(stage, "/World/Curtain", cloth), ecru)
    sky = UsdLux.RectLight.Define(stage, "/World/Lights/Window")
    sky.CreateWidthAttr(3.0)
    sky.CreateHeightAttr(2.4)
    sky.CreateIntensityAttr(3.2)
    sky.CreateColorAttr((0.80, 0.90, 1.0))
    frame = UsdGeom.Xformable(sky)
    frame.AddTranslateOp().Set(Gf.Vec3d(0.0, 1.8, WALL - 1.0))
    frame.AddRotateXOp().Set(180.0)
    sun = UsdLux.DistantLight.Define(stage, "/World/Lights/Sun")
    sun.CreateIntensityAttr(4.5)
    sun.CreateAngleAttr(0.6)
    sun.CreateNormalizeAttr(True)
    sun.CreateColorAttr((1.0, 0.86, 0.68))
    UsdGeom.Xformable(sun).AddRotateXYZOp().Set(Gf.Vec3f(-24.0, 156.0, 0.0))
    camera(stage, (0.65, 1.45, 2.9), (0.02, 1.22, 0.0), 38.0)
    stage.GetRootLayer().Save()
    return path


def _pleated(across: int, up: int) -> Grid:
    """Two panels of cloth, drawn apart a little, in pleats that open towards the hem."""
    width, height, fullness = WINDOW[0] + 0.4, 2.15, 2.0
    s, y = np.meshgrid(
        np.linspace(0, 1, across), np.linspace(0.12, height + 0.12, up), indexing="ij"
    )
    down = 1.0 - (y - y.min()) / height
    phase = 2 * math.pi * 11 * (s + 0.012 * np.sin(2 * math.pi * 3.1 * s) * (0.4 + down))
    depth = 0.032 + 0.022 * down + 0.006 * np.sin(2 * math.pi * 2.3 * s + 1.0)
    # The panels meet in the middle at the rod and stand 16 cm apart at the hem.
    x = (s - 0.5) * width
    x = x + np.sign(s - 0.5) * 0.08 * down**1.5 * (1.0 - np.abs(2 * s - 1))
    x = x + 0.012 * np.sin(2 * phase) + 0.02 * down * np.sin(2 * math.pi * 1.7 * s)
    z = depth * np.sin(phase) + 0.012 * down * np.sin(0.5 * phase + 2.0)
    uv = np.stack([s * width * fullness, y], axis=-1)
    return Grid(np.stack([x, y, z], axis=-1), uv)


def _room(stage: Usd.Stage) -> None:
    """Define a floor, the wall around the window, and the window's bars."""
    grey(stage, "/World/Looks/Wall", (0.62, 0.60, 0.56), 0.9)
    grey(stage, "/World/Looks/Boards", (0.34, 0.24, 0.16), 0.5)
    grey(stage, "/World/Looks/Frame", (0.75, 0.74, 0.70), 0.6)
    half, top = WINDOW[0] / 2, SILL + WINDOW[1]
    walls = {
        "Left": (-3.0, -half, 0.0, 3.0), "Right": (half, 3.0, 0.0, 3.0),
        "Below": (-half, half, 0.0, SILL), "Above": (-half, half, top, 3.0),
    }  # fmt: skip
    for name, sides in walls.items():
        _rectangle(stage, f"/World/Wall{name}", sides, WALL, "/World/Looks/Wall")
    bars = {
        "Upright": (-0.025, 0.025, SILL, top),
        "Across": (-half, half, SILL + 0.95, SILL + 0.99),
    }
    for name, sides in bars.items():
        _rectangle(stage, f"/World/Bar{name}", sides, WALL - 0.03, "/World/Looks/Frame")
    x, z = np.meshgrid((-3.0, 3.0), (4.0, WALL), indexing="ij")
    floor = np.stack([x, np.zeros_like(x), z], axis=-1)
    bind(stage, define_grid(stage, "/World/Boards", Grid(floor, floor[..., ::2])),
         "/World/Looks/Boards")  # fmt: skip


def _rectangle(
    stage: Usd.Stage, path: str, sides: tuple[float, float, float, float], z: float, look: str
) -> None:
    """Define an upright rectangle that faces +z; sides : left, right, bottom, top [m]."""
    x, y = np.meshgrid(sides[:2], sides[2:], indexing="ij")
    points = np.stack([x, y, np.full_like(x, z)], axis=-1)
    bind(stage, define_grid(stage, path, Grid(points, points[..., :2])), look)

"""Sheets that remake pictures of the thesis: [Bisker2011] Figures 5.3, 5.4 and 5.6."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.shadow.methods import shadowing
from fabricusd.appearance.surface import evaluate
from fabricusd.chart.draw import pyplot, save
from fabricusd.chart.highlights import predicted
from fabricusd.chart.scenes import RADIUS, cloth, curtain, cylinder, facing, sky, sun
from fabricusd.fabric import Fabric, Thread
from fabricusd.geometry.nearest import published
from fabricusd.images.view import encode
from fabricusd.reference.render import render_scene
from fabricusd.scene.scene import Scene

Picture = NDArray[np.float32]

WRAPS = ("vertical", "horizontal", "diagonal")
"""How the filament threads run on the cylinders, from left to right on the sheet."""

FILAMENT = {
    "linen_plain": "warp",
    "silk_crepe_de_chine": "weft",
    "polyester_satin_charmeuse": "warp",
}
"""The set of each fabric's threads by which the wraps are named."""

TO_LIGHT = np.array([0.0, 0.35, 1.0]) / math.hypot(0.35, 1.0)
SUN = 1.5
"""Angular diameter of the light [degrees]."""

SIX = (
    "polyester_satin_charmeuse", "silk_crepe_de_chine", "silk_shot", "velvet", "linen_plain",
    "wool_flannel",
)  # fmt: skip
"""Figure 5.4's fabrics, (a) to (f)."""


def wrap_degrees(name: str, wrap: str) -> float:
    """Rotation of the grain [degrees] at which the filament threads run as `wrap` says."""
    turn = {"vertical": 0.0, "horizontal": 90.0, "diagonal": 45.0}[wrap]
    return turn if FILAMENT[name] == "warp" else turn + 90.0


def filament(name: str, fabric: Fabric) -> Thread:
    """The filament thread of a fabric, by which the wraps are named."""
    threads = fabric.warp if FILAMENT[name] == "warp" else fabric.weft
    return fabric.thread_list[threads.sequence[0]]


def cylinders(fabric: Fabric, degrees: tuple[float, ...], ambient: float = 0.08) -> Scene:
    """Upright cylinders side by side, the grain turned by `degrees`, lit from above the viewer."""
    apart = 2.2 * RADIUS
    middle = 0.5 * (len(degrees) - 1)
    return Scene(
        meshes=[cylinder(apart * (k - middle), material=k) for k in range(len(degrees))],
        materials=[cloth(fabric, turn) for turn in degrees],
        lights=[sky(ambient), sun(TO_LIGHT, 2.5, SUN)],
        camera=facing(apart * len(degrees), 2 * RADIUS),
    )


def cylinder_sheet(folder: Path, quick: bool) -> list[Path]:
    """Figure 5.6: three fabrics on cylinders, wrapped three ways; ticks mark the highlights due."""
    plt = pyplot()
    across, samples = (99, 8) if quick else (480, 64)
    figure, rows = plt.subplots(3, 1, figsize=(8, 8.2), layout="constrained")
    for axes, name in zip(rows, FILAMENT, strict=True):
        fabric = published(name)
        scene = cylinders(fabric, tuple(wrap_degrees(name, w) for w in WRAPS))
        made = render_scene(scene, width=across, height=round(across / 3.3), spp=samples)
        axes.imshow(_bright(made.layers["beauty"]), extent=(-3.3, 3.3, -1, 1))
        for p in predicted(filament(name, fabric).curve, TO_LIGHT):
            axes.plot([math.sin(p)] * 2, [-1.13, -1.03], color="C3", lw=1.5, clip_on=False)
        axes.set_xticks([-2.2, 0, 2.2], WRAPS)
        axes.set_yticks([])
        axes.set_ylim(-1.15, 1)
        axes.set_ylabel(name, fontsize=8)
        axes.tick_params(length=0, pad=8)
    return save(figure, folder / "cylinders", (".png",))


def shadow_sheet(folder: Path, quick: bool) -> list[Path]:
    """Figure 5.3: crepe from above, light from the left: unshadowed, shadowed, and the mask."""
    plt = pyplot()
    size = 60 if quick else 360
    fabric = published("silk_crepe_de_chine")
    line = (np.arange(size) + 0.5) / size * 2 * fabric.weave.ends
    v, u = np.meshgrid(line, line, indexing="ij")
    uv = np.stack((u.ravel(), v.ravel()), axis=1)
    elevation = math.radians(15.0)
    wi, wo = np.array([-math.cos(elevation), 0.0, math.sin(elevation)]), np.array([0.0, 0.0, 1.0])
    bare = evaluate(fabric, wi, wo, uv, "weave")
    scale = 0.8 / float(np.quantile(bare, 0.98))
    methods = ("peak", "horizon", "traced")
    figure, grid = plt.subplots(3, 3, figsize=(8, 8.3), layout="constrained")
    for row, method in zip(grid, methods, strict=True):
        mask = shadowing(fabric, np.tile(wi, (len(uv), 1)), uv, method)
        shown = {
            "unshadowed": bare,
            f"shadowed by {method}": evaluate(fabric, wi, wo, uv, "weave", method),
            "mask": np.repeat(np.clip(mask, 0, 1)[:, None], 3, axis=1) / scale,
        }
        for axes, (label, value) in zip(row, shown.items(), strict=True):
            light = np.clip(value * scale, 0, 1).reshape(size, size, 3) ** (1 / 2.2)
            axes.imshow(light, origin="lower")
            axes.set_title(label, fontsize=8)
            axes.set_axis_off()
    return save(figure, folder / "shadowed", (".png",))


def drape_sheet(folder: Path, quick: bool) -> list[Path]:
    """Figure 5.4: six fabrics on a hanging cloth, 4 bounces."""
    plt = pyplot()
    across, samples = (36, 8) if quick else (160, 64)
    figure, grid = plt.subplots(2, 3, figsize=(9, 6.6), layout="constrained")
    for axes, name in zip(grid.ravel(), SIX, strict=True):
        scene = Scene(
            meshes=[curtain()],
            materials=[cloth(published(name))],
            lights=[sky(0.25), sun((-0.9, 0.8, 1.0), 2.2, 8.0)],
            camera=facing(0.5, 0.5, (0.15, 0.12, 1.0)),
        )
        made = render_scene(scene, width=across, height=across, spp=samples, max_bounces=4)
        axes.imshow(_bright(made.layers["beauty"]))
        axes.set_title(name, fontsize=8)
        axes.set_axis_off()
    return save(figure, folder / "draped", (".png",))


def _bright(beauty: NDArray[Any]) -> Any:
    """A display picture, exposed so that only its brightest hundredth is clipped."""
    light = beauty[..., :3]
    top = float(np.quantile(light.max(axis=-1), 0.99))
    return encode(light, -math.log2(max(top, 1e-6)))


SHEETS: dict[str, tuple[str, Callable[[Path, bool], list[Path]]]] = {
    "cylinders": (
        "Figure 5.6: linen, crêpe de Chine and satin on a cylinder, with the filament threads "
        "upright, round and aslant; ticks mark where the tangent curve puts the highlights",
        cylinder_sheet,
    ),
    "shadowed": (
        "Figure 5.3: crêpe de Chine from above, with light from the left at 15°: unshadowed, "
        "shadowed, and the mask",
        shadow_sheet,
    ),
    "draped": ("Figure 5.4: six fabrics on a hanging cloth", drape_sheet),
}
"""Name -> (caption, function that draws it into a folder, quick or not)."""

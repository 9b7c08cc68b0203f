"""Golden pictures: what each shows, and the command that makes them anew after a wanted change.

    python -m tests.reference.goldens [NAME...]

24 x 24 pixels, 4096 samples; an EXR holds the mean and the variance of the mean.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fabricusd.fabric import even
from fabricusd.images.files import write_exr
from fabricusd.reference.film import AOVS
from fabricusd.reference.render import RenderResult
from fabricusd.scene.light_kinds import DOME, RECT
from fabricusd.scene.scene import Camera, Light, Mesh, PreviewSurface
from fabricusd.schema import load
from tests.reference.scenes import cloth, grid, lambert, looking, picture, sphere

FOLDER = Path(__file__).parent / "golden"
SIZE = 24
SAMPLES = 4096

CASES: dict[str, dict[str, Any]] = {
    # name: fabric, of even threads unless told, threads to a unit of UV, level, shadowing; the
    # cloth, over a floor, under a picture and a lamp
    "satin_far": {"preset": "polyester_satin_charmeuse", "level": "far", "shadow": "horizon"},
    "silk_thread": {"preset": "silk_shot", "level": "thread", "threads": 12.0},
    "linen_auto": {"preset": "linen_plain", "level": "auto", "threads": 40.0},
    "velvet_weave": {"preset": "velvet", "level": "weave", "threads": 12.0},
    "satin_horizon": {"preset": "polyester_satin_charmeuse", "shadow": "horizon", "threads": 24.0},
    "silk_ball": {"preset": "silk_shot{appearance=published}", "shadow": "horizon",
                  "threads": 12.0, "cloth": "ball"},
    "linen_skirt": {"preset": "linen_plain", "shadow": "horizon", "threads": 24.0,
                    "cloth": "skirt", "spp": 4 * SAMPLES},
    "linen_uneven": {"preset": "linen_plain", "level": "thread", "shadow": "horizon",
                     "threads": 24.0, "uneven": True},
}  # fmt: skip


def _folds() -> Mesh:
    return grid(lambda x, z: 0.12 * np.sin(9 * x) * np.cos(5 * z), cells=40)


def _ball() -> Mesh:
    """A closed, symmetric mesh whose normals are left to the tracer; coarse, so that they show."""
    return replace(sphere(cells=10, radius=0.35), normals=None)


def _skirt() -> Mesh:
    """A flared tube with a seam down its back, whose normals are left to the tracer; coarse too."""
    around, up = np.meshgrid(np.linspace(0, 1, 17), np.linspace(0, 1, 5))
    phi, radius = 2 * np.pi * around, 0.42 - 0.24 * up
    points = np.stack([radius * np.sin(phi), 0.6 * up - 0.3, radius * np.cos(phi)], axis=-1)
    i = np.arange(points[..., 0].size).reshape(up.shape)
    a, b, c, d = (k.ravel() for k in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    uv = np.stack([1.9 * around, 0.65 * up], axis=-1).reshape(-1, 2)[triangles]
    return Mesh(
        path="skirt", points=points.reshape(-1, 3), triangles=triangles, uv=uv,
        material=np.zeros(len(triangles), int),
    )  # fmt: skip


CLOTHS: dict[str, Callable[[], Mesh]] = {"folds": _folds, "ball": _ball, "skirt": _skirt}


def render_case(
    name: str,
    *,
    spp: int,
    seed: int,
    brightness: float = 1.0,
    smooth: bool = True,
    sampler: str = "sobol",
) -> RenderResult:
    """One golden picture's scene; `brightness` scales its lamp, not `smooth` shows its facets."""
    case = CASES[name]
    mesh = replace(CLOTHS[case.get("cloth", "folds")](), smooth=smooth)
    floor = replace(grid(size=3.0, material=1), path="floor")
    floor = replace(floor, points=floor.points - [0.0, 0.3, 0.0])
    plate = replace(grid(size=0.5, material=2), path="plate")
    plate = replace(plate, points=plate.points - [-0.5, 0.1, -0.3])
    image = np.random.default_rng(3).uniform(0.2, 1.0, (8, 16, 3)).astype(np.float32)
    lights = [
        Light(path="sky", kind=DOME, radiance=(1, 1, 1), image=image),
        Light(
            path="lamp", kind=RECT, width=0.8, height=0.8,
            radiance=(6 * brightness,) * 3, frame=looking((0.6, 1.0, 0.4)),
        ),
    ]  # fmt: skip
    gloss = PreviewSurface(diffuse=(0.5, 0.3, 0.1), roughness=0.3)
    fabric = load(case["preset"])
    fabric = fabric if case.get("uneven") else even(fabric)
    material = cloth(fabric, case.get("threads", 40.0))
    camera = Camera(frame=looking((0.7, 1.4, 1.0)), aperture=(0.03, 0.03))
    return picture(
        [mesh, floor, plate], [material, lambert(0.6), gloss], lights, camera, size=SIZE, spp=spp,
        level=case.get("level", "auto"), shadow=case.get("shadow", "none"), seed=seed,
        sampler=sampler, pixel_filter="spline",
    )  # fmt: skip


def main() -> None:
    """Make the goldens named, or all."""
    FOLDER.mkdir(exist_ok=True)
    for name in sys.argv[1:] or CASES:
        r = render_case(name, spp=CASES[name].get("spp", SAMPLES), seed=1)
        path = FOLDER / f"{name}.exr"
        write_exr(path, {k: r.layers[k] for k in ("beauty", "variance")}, AOVS, {})
        print(path)


if __name__ == "__main__":
    main()

"""Write docs/yarn.md and its pictures: what uneven yarn is, and what it keeps.

python docs/make_yarn.py [--page]

--page leaves the pictures as they are.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import surface
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding, Fabric, even
from fabricusd.geometry import radiance_at, tubes
from fabricusd.images.files import write_png
from fabricusd.reference.render import render_scene
from fabricusd.scene.light_kinds import DISTANT, DOME
from fabricusd.scene.scene import Camera, FabricSurface, Light, Mesh, Scene
from fabricusd.schema import load, published_names
from fabricusd.schema.describe import yarn_words

HERE = Path(__file__).resolve().parent
Floats = NDArray[np.float64]

LIGHTS = (((-0.7, 0.5, 0.8), 3.0), ((0.5, -0.4, 0.8), 0.8))
"""Directions and irradiances of the close-ups, seen from above."""

PIXELS, THREADS, INSIDE = 20, 13, 3
"""Pixels a thread, threads a picture, samples along a pixel of the close-ups."""

DISTANCES = (60.0, 20.0, 6.0, 2.0)
"""Pixels a thread of the second picture."""
SIDE = 300
"""Pixels of its parts."""

WINDOW, SAMPLES = 64.0, 768
"""Threads along a window whose mean is compared with the even cloth's, and samples along it."""
PAIRS = (
    ((0.48, 0.36, 0.8), (-0.1, -0.28, 0.955)),
    ((-0.7, 0.5, 0.51), (0.0, 0.0, 1.0)),
    ((0.1, -0.95, 0.3), (0.3, 0.6, 0.74)),
)
"""Light and view of the comparison."""

ATTRIBUTES = (
    ("`thread:unevenness:cv`", "ratio", "CVm, the coefficient of variation of the mass of pieces "
     "8 mm long, as evenness testers give it; the width varies by half of it"),
    ("`thread:unevenness:length`", "mm", "distance along the thread over which thickness and shade "
     "change; 0 is refused where either varies"),
    ("`thread:unevenness:count`", "ratio", "coefficient of variation of the mass from thread to "
     "thread"),
    ("`thread:unevenness:shade`", "ratio", "standard deviation of the albedo over the albedo, half "
     "of its variance along the thread and half between threads"),
    ("`thread:slub:amount`, `length`, `spacing`", "ratio, mm, mm", "how much wider the middle of a "
     "slub is, how long slubs are, how far apart"),
    ("`thread:plies`, `thread:twist`", "number, turns/m", "yarns that wind round one another; Z "
     "above 0, S below"),
    ("`fabric:unevenness:seed`", "number", "chooses one of many cloths whose threads are alike"),
)  # fmt: skip

HEAD = """# Yarn as it is spun

Made by `make docs` (`python docs/make_yarn.py`).

Yarn is thick here and thin there, and no two threads are alike. Without that, cloth looks like cord
from near. The attributes of a thread say how uneven it is; their fallbacks are those of a wire.

| attribute | unit | means |
|---|---|---|
{attributes}

A thread that is thick and thin also lies a little off its place where it has room, and the crest of
each of its floats a little off the middle.

![Close-ups of presets](images/yarn.png)

Twenty pixels a thread: even, uneven, and `geometry` of the same uneven threads. Presets by rows:
{rows}. Tubes keep the crests of floats in the middle and show no plies. Velvet has no tubes here:
`geometry` takes pile for even only.

![Single yarns](images/yarn_threads.png)

The same for the presets of one yarn: {singles}.

![From near and from far](images/yarn_distance.png)

{distances} pixels a thread, even above and uneven below, by the path tracer at `--level auto`:
linen, then rayon shantung. Last, linen of two plies with Z and with S twist: {plied}.

## What is kept
- Level `far` does not see yarn: it has the same bits.
- Unevenness moves places, not laws: a place of uneven cloth is a place of the even one, elsewhere.
  All that is known of the even cloth (curves, heights, horizon tables, cell tables of a bake) is
  looked up there, so what law and shadow have in common is kept. A thread is 1 + e times as wide; e
  has the mean 0 and is independent of the threads that cross, so the areas of the sets, of the gap
  and of each tangent angle are kept on average.
- Where threads have room, their edges part. Where they touch, the border between two of them moves,
  so that no gap opens. No thread falls below {least:.0%} of its width.
- The numbers behind e are opposite in pairs, along a thread and from thread to thread. The mean
  over a window therefore differs from the even cloth's by something that falls as 1/length.
- The pixel's footprint evens the noise out along the thread.
- The shade has the mean 1. It is limited so that no albedo falls below 0, or of `conserving`
  threads rises above 1; light that scatters more than once takes the mean.
- Plies move the place across the thread at which level `thread` evaluates the law, by a map that
  shows every place equally often. That keeps the mean of the law. Under a shadow it does not quite:
  shadows know where light meets a round thread, and the strands of a ply look elsewhere. With three
  plies, crêpe de Chine is 6 % brighter.

Differences of the mean over {window:.0f} by {window:.0f} threads from that of the even cloth, the
largest of {pairs} pairs of light and view and of three channels, in percent:

| preset | `weave` | `weave`, horizon | `thread`, horizon | yarn |
|---|---|---|---|---|"""

TAIL = """
The figures of the presets are derived, not published with their fabrics. Spun yarn is given what is
usual for its kind in tables of evenness testers (Uster statistics): CVm .12 to .13 for polyester
and rayon, .15 for spun silk, .17 to .18 for wool, .20 to .22 for linen. Filament has .01 to .02,
raw silk varies by .06 from thread to thread. Shantung has its slubs in the weft.

## In a bake
A repeat no longer repeats. The finest level is looked up in the cell table all the same: a texel
takes the entry of the place at which even threads look as they do there, and its colours take the
shades of the threads under its centre. Coarser levels are means of it. `thread_id` tells the thread
that is there, and `weave_coordinate` the place on the even cloth. A BTF is made to be repeated, and
is even.

## What is missing
Fibres on the yarn's surface: from 40 pixels a thread on, spun yarn looks too smooth. (Fibres that
stand off it are [fuzz](fuzz.md).) Heights and horizons are those of even threads, so a slub is
wider but no higher.
"""


def spots(fabric: Fabric) -> Floats:
    """(n, 2) places of a close-up [threads], rows from above."""
    line = (np.arange(PIXELS * THREADS * INSIDE) + 0.5) / (PIXELS * INSIDE)
    x, y = np.meshgrid(line, line[::-1])
    wide = max(fabric.warp.pitch, fabric.weft.pitch)
    return np.stack(
        (x.ravel() * wide / fabric.warp.pitch, y.ravel() * wide / fabric.weft.pitch), axis=1
    )


def pixels(values: Floats) -> Floats:
    """(h, w, 3) pixels of samples (n, 3)."""
    side = PIXELS * THREADS
    return values.reshape(side, INSIDE, side, INSIDE, 3).mean(axis=(1, 3))


def by_level(fabric: Fabric) -> Floats:
    """A close-up at level `thread` with horizons."""
    uv, total = spots(fabric), 0.0
    for direction, power in LIGHTS:
        wi = np.array(direction) / np.linalg.norm(direction)
        total = total + power * surface.evaluate(
            fabric, wi, (0.0, 0.0, 1.0), uv, "thread", "horizon"
        )
    return pixels(np.asarray(total))


def by_tubes(fabric: Fabric) -> Floats:
    """The same close-up of tubes; grey where there are none."""
    uv = spots(fabric)
    try:
        cloth = tubes(fabric, threads=tuple(int(x) + 1 for x in uv.max(axis=0)))
    except FabricError:
        return np.full((PIXELS * THREADS,) * 2 + (3,), np.nan)
    total = np.zeros((len(uv), 3))
    for direction, power in LIGHTS:
        wi = np.array(direction) / np.linalg.norm(direction)
        total += power * radiance_at(cloth, uv, (0.0, 0.0, 1.0), wi)
    return pixels(total)


def framed(parts: Sequence[Floats], scale: float) -> Floats:
    """Parts side by side, coded for a display."""
    coded = [np.clip(np.nan_to_num(part * scale, nan=0.2), 0, 1) ** (1 / 2.2) for part in parts]
    return np.concatenate([np.pad(c, ((2, 2), (2, 2), (0, 0))) for c in coded], axis=1)


def close_ups(names: Sequence[str], columns: int, target: Path) -> None:
    """Even, uneven and tubes of each preset, `columns` presets a row."""
    found = []
    for name in names:
        fabric = load(name)
        parts = [by_level(even(fabric)), by_level(fabric), by_tubes(fabric)]
        found.append(framed(parts, 0.85 / float(np.percentile(parts[0], 98.5))))
        print(name)
    while len(found) % columns:
        found.append(np.zeros_like(found[0]))
    rows = [np.concatenate(found[k : k + columns], axis=1) for k in range(0, len(found), columns)]
    write_png(target, (np.concatenate(rows) * 255).astype(np.uint8))


def distant(fabric: Fabric, per_thread: float) -> Floats:
    """A square of cloth from above, by the path tracer."""
    size = SIDE / per_thread * max(fabric.warp.pitch, fabric.weft.pitch)
    half = 0.75 * size
    corners = np.array([(-half, 0, half), (half, 0, half), (half, 0, -half), (-half, 0, -half)])
    triangles = np.array([(0, 1, 2), (0, 2, 3)])
    plane = np.stack((corners[:, 0], -corners[:, 2]), axis=1)
    mesh = Mesh(
        path="cloth", points=corners, triangles=triangles, uv=plane[triangles],
        material=np.zeros(2, np.int32),
    )  # fmt: skip
    frame = np.eye(4)
    frame[:3, :3] = np.array([(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)])
    frame[1, 3] = 1.0
    camera = Camera(frame=frame, orthographic=True, aperture=(size, size))
    lights = [sun(direction, power) for direction, power in LIGHTS]
    lights.append(Light(path="sky", kind=DOME, radiance=(0.35,) * 3))
    scene = Scene(
        meshes=[mesh], lights=lights, camera=camera,
        materials=[FabricSurface(binding=Binding(fabric=fabric, metres_per_uv=1.0))],
    )  # fmt: skip
    made = render_scene(scene, width=SIDE, height=SIDE, spp=48, max_bounces=1)
    return np.asarray(made.layers["beauty"][..., :3], np.float64)


def sun(direction: tuple[float, float, float], power: float) -> Light:
    """A distant light towards `direction` of the cloth's frame: x, -z and y of the scene."""
    back = np.array((direction[0], direction[2], -direction[1])) / np.linalg.norm(direction)
    right = np.cross((0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    frame = np.eye(4)
    frame[:3, 0], frame[:3, 1], frame[:3, 2] = right, np.cross(back, right), back
    return Light(path="sun", kind=DISTANT, radiance=(power,) * 3, frame=frame)


def plied(turns: float) -> Fabric:
    """Linen of two plies, more even than single yarn, as doubling makes it."""
    fabric = load("linen_plain")
    changes = {"unevenness_cv": 0.12, "slub_amount": 0.0, "plies": 2, "twist": turns}
    return replace(fabric, threads={k: replace(t, **changes) for k, t in fabric.threads.items()})


def distances(target: Path) -> None:
    """Even above, uneven below, from near to far."""
    columns = []
    for name in ("linen_plain", "rayon_shantung"):
        fabric = load(name)
        for per_thread in DISTANCES:
            parts = [distant(f, per_thread) for f in (even(fabric), fabric)]
            scale = 0.85 / float(np.percentile(parts[0], 98.5))
            columns.append(np.concatenate([framed([p], scale) for p in parts]))
    parts = [distant(plied(turns), DISTANCES[0]) for turns in (450.0, -450.0)]
    columns.append(
        np.concatenate([framed([p], 0.85 / float(np.percentile(p, 98.5))) for p in parts])
    )
    half = len(DISTANCES)
    blank = np.zeros_like(columns[0])
    rows = [
        np.concatenate([*columns[:half], columns[-1]], axis=1),
        np.concatenate([*columns[half : 2 * half], blank], axis=1),
    ]
    write_png(target, (np.concatenate(rows) * 255).astype(np.uint8))


def change(fabric: Fabric, level: str, shadow: str) -> float:
    """Largest difference of a window's mean from the even cloth's [%]."""
    rng = np.random.default_rng(0)
    grid = np.stack(np.meshgrid(np.arange(SAMPLES), np.arange(SAMPLES)), axis=-1).reshape(-1, 2)
    uv = 1000.0 + (grid + rng.random(grid.shape)) * WINDOW / SAMPLES
    worst = 0.0
    for light, view in PAIRS:
        wi, wo = (np.array(w) / np.linalg.norm(w) for w in (light, view))
        found, true = (
            surface.evaluate(f, wi, wo, uv, level, shadow).mean(axis=0)
            for f in (fabric, even(fabric))
        )
        seen = true > 1e-3 * true.max()
        worst = max(worst, float(np.abs(found[seen] / true[seen] - 1).max()))
    return 100.0 * worst


def row(name: str) -> str:
    """The row of one preset."""
    fabric = load(name)
    figures = [
        change(fabric, level, shadow)
        for level, shadow in (("weave", "none"), ("weave", "horizon"), ("thread", "horizon"))
    ]
    words = "; ".join(dict.fromkeys(yarn_words(t) for t in fabric.threads.values()))
    return f"| {name} | {' | '.join(f'{x:.2f}' for x in figures)} | {words} |"


def main() -> None:
    """Write the page, and the pictures unless `--page` leaves them."""
    from fabricusd.appearance.weave.yarn.compiled import LEAST

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", action="store_true")
    options = parser.parse_args()
    fabrics = [
        n for n in published_names() if not n.startswith("thread_") and not n.endswith("back")
    ]
    singles = [n for n in published_names() if n.startswith("thread_")]
    if not options.page:
        close_ups(fabrics, 2, HERE / "images" / "yarn.png")
        close_ups(singles, 2, HERE / "images" / "yarn_threads.png")
        distances(HERE / "images" / "yarn_distance.png")
    words = HEAD.format(
        attributes="\n".join(f"| {' | '.join(row)} |" for row in ATTRIBUTES),
        rows=", ".join(fabrics), singles=", ".join(singles), least=LEAST, window=WINDOW,
        pairs=len(PAIRS), plied=yarn_words(plied(450.0).thread_list[0]),
        distances=", ".join(f"{x:g}" for x in DISTANCES),
    )  # fmt: skip
    lines = [words, *(row(name) for name in published_names()), TAIL]
    (HERE / "yarn.md").write_text("\n".join(lines))


if __name__ == "__main__":
    main()

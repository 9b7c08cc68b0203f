"""Write docs/fuzz.md and its picture: fibres that stand off hairy yarn, and how true they are.

python docs/make_fuzz.py [--page]

--page leaves the picture as it is.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import surface
from fabricusd.appearance.fuzz import FIBRE, bald, optical_depth
from fabricusd.chart.panels import fuzz as panel
from fabricusd.fabric import Binding, Fabric
from fabricusd.geometry import fibres, paths, tubes
from fabricusd.images.files import write_png
from fabricusd.reference.render import render_scene
from fabricusd.scene.light_kinds import DISTANT, DOME
from fabricusd.scene.scene import Camera, FabricSurface, Light, Mesh, Scene
from fabricusd.schema import load

HERE = Path(__file__).resolve().parent
Floats = NDArray[np.float64]

SIDE, RADIUS = 320, 0.02
SHOWN = (("denim", 0.0), ("denim", 3.0), ("denim", 9.0), ("worsted_twill", 0.0),
         ("worsted_twill", 2.0), ("worsted_twill", 9.0))  # fmt: skip

DEGREES = (0, 40, 60, 75, 83)

HEAD = """# Fuzz

Made by `make docs` (`python docs/make_fuzz.py`).

`thread:hairiness` is Uster's H: the length of the fibres that protrude from a yarn, over the length
of the yarn. Half of them stand on each face of the cloth, as a layer that hides part of it. Fuzz
shows at grazing views, where the way through the layer is long: it takes the contrast from a
garment's rim.

```
fabricusd set cloth.usda hairiness=4
```

| yarn in finished cloth | H |
|---|---|
| filament | 0 |
| cotton, combed, singed | 1.5 |
| cotton, carded | 2 to 3 |
| worsted, two plies | 2 |
| cotton, softly twisted, not singed | 4 |
| woollen, milled | 10 |

The figures are derived: evenness testers find H of 3 to 8 on cotton yarn (Uster statistics), and
finishing is taken to leave a third. The presets of the trade have them. The published presets have
none, since their laws were fitted as they are.

![Cylinders of denim and of worsted twill](images/fuzz.png)

By the path tracer, light from the left and from behind: denim of H 0, 3 and 9 above, worsted twill
of H 0, 2 and 9 below.

## The layer
Fibres {fibre:.0f} micrometres thick point anywhere above the threads. Each scatters as its thread
does, light meets one of them at most, and what they scatter downwards reaches the cloth. The
formulas are in `appearance/fuzz.py`; [decision 021](decisions/021-fuzz.md) says why. The layer is
the same at every level, in bakes, in fits and in the colour that `new` and `set` solve for. White
fibres on white cloth lose no light on average. Gaps stay as open as they are.

## How true it is
The reference is the cloth as tubes from which straight fibres stand, traced by Embree with all
bounces (`geometry.fibres`). Mean absolute difference over the mean value, for {pairs} pairs of
directions up to {steepest:.0f} degrees; `bald` is the law against tubes, both without fibres:

| preset | optical depth | view | noise | with fuzz | without | bald |
|---|---|---|---|---|---|---|"""

MIDDLE = """
Share of a white sky's light that comes back, with fibres less without, by tubes and by the law:

| preset | """

TAIL = """
## What is missing
- Shadows and what they hide are taken to be independent. A fibre and its shadow share a root, so in
  the plane of light and view the tubes are up to twice as bright beside the light, and darker
  opposite it. Over all azimuths that cancels.
- Light from beyond a silhouette's edge lights no fibre there: the layer has no thickness.
- Published threads are brighter than white. Their fibres are not: they are held to an albedo of 1.
- The path tracer draws directions as for cloth without fuzz.
- The OSL shader has no fuzz.
"""


def hairy(name: str, hairiness: float) -> Fabric:
    """A preset of threads that are all as hairy."""
    fabric = load(name)
    threads = {k: replace(t, hairiness=hairiness) for k, t in fabric.threads.items()}
    return replace(fabric, threads=threads)


def cylinder(fabric: Fabric) -> Floats:
    """(SIDE, SIDE, 3) a cylinder of cloth lit from the left, and from behind."""
    angle = np.linspace(-math.pi, math.pi, 129)
    x, y = np.sin(angle) * RADIUS, np.array([-4.0, 4.0]) * RADIUS
    points = np.array(
        [(a, b, np.cos(t) * RADIUS) for b in y for a, t in zip(x, angle, strict=True)]
    )
    uv = np.array([(t * RADIUS, b) for b in y for t in angle])
    k = np.arange(128)
    triangles = np.concatenate(
        (np.stack((k, k + 1, k + 130), axis=1), np.stack((k, k + 130, k + 129), axis=1))
    )
    mesh = Mesh(
        path="cloth", points=points, triangles=triangles, uv=uv[triangles],
        material=np.zeros(len(triangles), np.int32),
    )  # fmt: skip
    frame = np.eye(4)
    frame[2, 3] = 1.0
    camera = Camera(frame=frame, orthographic=True, aperture=(2.1 * RADIUS,) * 2)
    lights = [
        _sun((-0.8, 0.4, 0.45), 2.0), _sun((0.9, 0.3, -0.55), 3.0),
        Light(path="sky", kind=DOME, radiance=(0.25,) * 3),
    ]  # fmt: skip
    scene = Scene(
        meshes=[mesh], lights=lights, camera=camera,
        materials=[FabricSurface(binding=Binding(fabric=fabric, metres_per_uv=1.0))],
    )  # fmt: skip
    made = render_scene(scene, width=SIDE, height=SIDE, spp=64)
    return np.asarray(made.layers["beauty"][..., :3], np.float64)


def _sun(direction: tuple[float, float, float], power: float) -> Light:
    back = np.array(direction) / np.linalg.norm(direction)
    right = np.cross((0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    frame = np.eye(4)
    frame[:3, 0], frame[:3, 1], frame[:3, 2] = right, np.cross(back, right), back
    return Light(path="sun", kind=DISTANT, radiance=(power,) * 3, frame=frame)


def picture(target: Path) -> None:
    """The cylinders of SHOWN, three a row."""
    parts = []
    for name, hairiness in SHOWN:
        parts.append(cylinder(hairy(name, hairiness)))
        print(name, hairiness, flush=True)
    rows = []
    for k in (0, 3):
        scale = 0.9 / float(np.percentile(parts[k], 99))
        rows.append(np.concatenate(parts[k : k + 3], axis=1) * scale)
    coded = np.clip(np.concatenate(rows), 0, 1) ** (1 / 2.2)
    write_png(target, (coded * 255).astype(np.uint8))


def rows(name: str) -> list[str]:
    """Rows of the first table."""
    wi, wo, true, noise = panel.measured(name, panel.PATHS)
    tubes_alone = panel.without_fibres(name, panel.PATHS)
    fabric = load(name)
    law, bare = (surface.evaluate(f, wi, wo) for f in (fabric, bald(fabric)))
    found = []
    for grazing in (False, True):
        on = (wo[:, 2] < math.cos(math.radians(panel.GRAZING))) == grazing
        scale = true[on].mean()
        figures = [
            noise[on].mean() / scale,
            *(np.abs(v - true)[on].mean() / scale for v in (law, bare)),
            np.abs(bare - tubes_alone)[on].mean() / tubes_alone[on].mean(),
        ]
        words = f"{'beyond' if grazing else 'up to'} {panel.GRAZING:.0f}°"
        found.append(
            f"| {name} | {optical_depth(fabric):.3f} | {words} | "
            f"{' | '.join(f'{x:.3f}' for x in figures)} |"
        )
    return found


def sky_row(name: str) -> str:
    """Change of the albedo by view, tubes then law."""
    fabric = load(name)
    mu = np.cos(np.radians(DEGREES))
    flat = np.sqrt(1 - mu * mu)
    wo = np.stack((0.8 * flat, 0.6 * flat, mu), axis=-1)
    traced = fibres.hairy_tubes(fabric, panel.THREADS)
    true = fibres.white_sky(traced, wo, count=1 << 17)[:, 0, 1]
    true = true - paths.albedo(tubes(bald(fabric)), wo, count=1 << 17).reflected[:, 1]
    law = [_sky(fabric, w) - _sky(bald(fabric), w) for w in wo]
    pairs = (f"{a:+.3f}, {b:+.3f}" for a, b in zip(true, law, strict=True))
    return f"| {name} | {' | '.join(pairs)} |"


def _sky(fabric: Fabric, wo: Floats) -> float:
    """Green of what a viewer receives under a white sky."""
    x, w = np.polynomial.legendre.leggauss(48)
    phi = (np.arange(96) + 0.5) * (2 * math.pi / 96)
    z, turn = (a.ravel() for a in np.meshgrid(0.5 * (x + 1), phi, indexing="ij"))
    flat = np.sqrt(1 - z * z)
    wi = np.stack((flat * np.cos(turn), flat * np.sin(turn), z), axis=-1)
    value = surface.evaluate(fabric, wi, wo)[:, 1]
    return float((np.repeat(0.5 * w, 96) * (2 * math.pi / 96)) @ value)


def main() -> None:
    """Write the page, and the picture unless `--page` leaves it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", action="store_true")
    if not parser.parse_args().page:
        picture(HERE / "images" / "fuzz.png")
    head = HEAD.format(fibre=FIBRE * 1e6, pairs=panel.PAIRS, steepest=panel.STEEPEST)
    lines = [head]
    for name in panel.PRESETS:
        lines += rows(name)
        print(lines[-1], flush=True)
    lines.append(MIDDLE + " | ".join(f"{d}°" for d in DEGREES) + " |")
    lines.append("|---" * (1 + len(DEGREES)) + "|")
    lines += [sky_row(name) for name in panel.PRESETS]
    lines.append(TAIL)
    (HERE / "fuzz.md").write_text("\n".join(lines))


if __name__ == "__main__":
    main()

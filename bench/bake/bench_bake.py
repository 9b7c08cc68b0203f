"""The time of a bake: compared with plain NumPy in one run, and as a whole.

    python bench/bake/bench_bake.py [--full SCENE]

The ratios are of processor time in one run, so that a busy machine does not matter. `--full` bakes
every map of SCENE at 4K and prints seconds and peak memory. See also bench/bake/bake_charts.py.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from fabricusd.appearance.weave.coverage import WARP
from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings
from fabricusd.bake.layout.garment import garments
from fabricusd.bake.texels import moment_indices as m
from fabricusd.bake.texels.angle_rows import steepness
from fabricusd.bake.texels.blocks import composed, layers_of
from fabricusd.bake.texels.maps import Texels, chosen_maps
from fabricusd.bake.texels.recipe import Recipe, recipe
from fabricusd.bake.texels.reflectance import FUZZ, SURFACE, VOLUME, reflectance_table
from fabricusd.bake.texels.sheet import sheets_of, texel_step
from fabricusd.fabric import Binding, Fabric
from fabricusd.scene.scene import FabricSurface, Mesh, Scene
from fabricusd.schema import load

SIDE = 4
"""Samples along the side of a texel in NumPy; the baker takes as many where it samples a texel."""


def square(fabric: Fabric, threads: float) -> Scene:
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    tri = np.array([[0, 1, 2], [0, 2, 3]])
    points = np.concatenate((corners, np.zeros((4, 1))), axis=1) * 0.01
    surface = FabricSurface(binding=Binding(fabric=fabric, threads_per_uv=(threads, threads)))
    mesh = Mesh(
        path="/Square", points=points, triangles=tri, uv=corners[tri],
        material=np.zeros(2, np.int32),
    )  # fmt: skip
    return Scene(meshes=[mesh], materials=[surface])


def plain_moments(made: Recipe, fabric: Fabric, step: np.ndarray, size: int) -> np.ndarray:
    """The same moments with NumPy's own functions: the weave by masks, tables by fancy indices."""
    cells = fabric.weave.cells
    ends, picks = cells.shape
    psi0 = _angles(fabric)
    total = np.zeros((m.HORIZON, size, size))
    split, thread = steepness(fabric), fabric.thread_list[0]
    horizon = np.zeros((m.AZIMUTHS, size, size))
    reflected = reflectance_table(fabric)
    table = made.table.astype(np.float32) ** 2 / 255.0**2
    y, x = np.mgrid[0:size, 0:size].astype(np.float64)
    rng = np.random.default_rng(0)
    for a in range(SIDE):
        for c in range(SIDE):
            u = step[0, 0] * (x + (a + rng.random(x.shape)) / SIDE)
            v = step[1, 1] * (y + (c + rng.random(x.shape)) / SIDE)
            i, j = np.floor(u).astype(int) % ends, np.floor(v).astype(int) % picks
            p, q = u - np.floor(u), v - np.floor(v)
            top = cells[i, j]
            along, over = np.where(top, q, p), np.where(top, p, q)
            width = np.where(top, made.cloth.width[WARP], made.cloth.width[0])
            seen = np.abs(over - 0.5) <= 0.5 * width
            s = (made.cloth.runs[i, j, 0, 0] + along) / made.cloth.runs[i, j, 0, 1]
            angle = psi0(s)
            slope = -np.tan(angle) * seen
            su, sv = np.where(top, 0.0, slope), np.where(top, slope, 0.0)
            narrow = min(thread.gamma_surface**2, 1.0)
            part = m.PARTS * top + 2 * (angle < 0) + (np.abs(angle) > split[top.astype(int)])
            total[m.COVER] += seen
            for k in range(2 * m.PARTS):
                mine = (part == k) & seen
                total[m.SHARE + k] += mine
                total[m.ANGLE + k] += np.where(mine, angle, 0.0)
                total[m.ANGLE_2 + k] += np.where(mine, angle * angle, 0.0)
            for k, of_set in enumerate((~top & seen, top & seen)):
                for channel in range(3):
                    total[m.TINT + 3 * k + channel] += of_set * thread.albedo[channel]
                total[m.LOBE_2 + k] += np.where(of_set, narrow, seen)
            for k, value in enumerate((su, sv, su * su, sv * sv, su * sv)):
                total[m.SLOPE + k] += value
            length = made.cloth.runs[i, j, 0, 1] * fabric.warp.pitch
            lift = made.cloth.half_height[0, 0]
            total[m.HEIGHT] += (np.interp(s, *_heights(fabric)) * length + lift) * seen
            total[m.FRESNEL] += seen * ((thread.ior - 1) / (thread.ior + 1)) ** 2
            at = np.degrees(angle) + 90.0
            low = np.clip(at.astype(int), 0, 179)
            values = reflected[top.astype(int), 0, low] * seen[..., None]
            total[m.SURFACE] += values[..., SURFACE]
            total[m.FUZZ] += values[..., FUZZ]
            for channel in range(3):
                total[m.VOLUME + channel] += values[..., VOLUME + channel]
            rows = np.clip((along * table.shape[3]).astype(int), 0, table.shape[3] - 1)
            columns = np.clip(((over - 0.5) / width + 0.5) * table.shape[4], 0, table.shape[4] - 1)
            found = table[i, j, 0, rows, columns.astype(int)] * seen[..., None]
            horizon += np.moveaxis(found, -1, 0)
    back = np.zeros((m.MOMENTS - m.BACK_COVER, size, size))
    return np.concatenate((total, horizon, back)) / SIDE**2


def _angles(fabric: Fabric):  # type: ignore[no-untyped-def]
    curve = fabric.thread_list[0].curve
    x = np.asarray(curve.positions) / curve.positions[-1]
    return lambda s: np.interp(s, x, curve.angles)


def _heights(fabric: Fabric) -> tuple[np.ndarray, np.ndarray]:
    s = np.linspace(0, 1, 257)
    slope = -np.tan(_angles(fabric)(s))
    return s, np.concatenate(([0.0], np.cumsum(0.5 * (slope[1:] + slope[:-1]) / 256)))


def against_numpy() -> None:
    """Compare every map of a sheet's finest level, tables included, with plain NumPy."""
    fabric = load("linen_plain")
    size, threads = 1024, 448.0
    one = garments(square(fabric, threads))[0]
    made = recipe(fabric)
    maps = chosen_maps(None, light=False)

    def ours(tables: bool) -> None:
        sheet = sheets_of(one, (made,), {1001: (0, 0)}, size, 0)[0]
        assert sheet.tables[0] is not None
        sheet = sheet if tables else replace(sheet, tables=(None,))
        for bx in range(sheet.across):
            for by in range(sheet.across):
                layers = next(layers_of(sheet, bx, by))
                for texture in maps:
                    composed(texture, layers, sheet.block_side)

    def plain() -> None:
        sheet = sheets_of(one, (made,), {1001: (0, 0)}, size, 0)[0]
        step = np.abs(texel_step(sheet, 0))
        for _ in range(sheet.across**2):
            found = plain_moments(made, fabric, step, sheet.block_side)
            texels = Texels.of_moments(found.reshape(m.MOMENTS, -1), made, one.lays[0])
            for texture in maps:
                if not texture.exact:
                    texture.function(texels).astype(texture.kind)

    ours(True), ours(False)
    looked_up, computed = _timed(lambda: ours(True)), _timed(lambda: ours(False))
    numpy = _timed(plain, 1)
    print(
        f"{len(maps)} maps of {size} x {size} texels, 1 worker: looked up {looked_up:.2f} s, "
        f"computed one by one {computed:.2f} s, plain NumPy without ids {numpy:.2f} s: "
        f"ratios {numpy / looked_up:.0f} and {numpy / computed:.1f}"
    )


def _timed(function, times: int = 3) -> float:  # type: ignore[no-untyped-def]
    best = np.inf
    for _ in range(times):
        began = time.process_time()
        function()
        best = min(best, time.process_time() - began)
    return best


def write_square(folder: str) -> str:
    """Write an OBJ file of a square of 10 cm."""
    path = Path(folder) / "square.obj"
    path.write_text(
        "v 0 0 0\nv .1 0 0\nv .1 .1 0\nv 0 .1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        "f 1/1 2/2 3/3 4/4\n"
    )
    return str(path)


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def full(scene: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        began, busy = time.perf_counter(), time.process_time()
        bake(scene, folder, Settings(resolution=4096, fit=True), fabric="linen_plain", workers=2)
        print(
            f"{scene} at 4096, every map, 2 workers: {time.perf_counter() - began:.1f} s, "
            f"{time.process_time() - busy:.1f} processor seconds, peak {_peak():.2f} GB"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--full", metavar="SCENE")
    options = parser.parse_args()
    against_numpy()
    if options.full:
        full(options.full)

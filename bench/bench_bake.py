"""How long a bake takes: against plain NumPy in one run, and by the number of texels.

    python bench/bench_bake.py [--full SCENE] [--btf]

Ratios in one run, so that a busy machine does not matter. `--full` bakes the whole map set of SCENE
at 4K and prints seconds and peak memory; `--btf` prints error against megabytes of the BTF's forms.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

from fabricusd.appearance.coverage import WARP
from fabricusd.bake import moments as m
from fabricusd.bake import planes
from fabricusd.bake.angle_rows import steepness
from fabricusd.bake.bake import Settings, bake
from fabricusd.bake.btf.write import FORMS, write_btf
from fabricusd.bake.garment import garments
from fabricusd.bake.recipe import Recipe, recipe
from fabricusd.bake.reflectance import reflectance_table
from fabricusd.bake.sheet import sheets_of, texel_step
from fabricusd.fabric import Binding, Fabric
from fabricusd.reference.scene import FabricSurface, Mesh, Scene
from fabricusd.schema import load

SIDE = 6
"""Samples along a texel's side, of both."""


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


def plain_planes(made: Recipe, fabric: Fabric, step: np.ndarray, size: int) -> np.ndarray:
    """The same planes with NumPy's own functions: the weave by masks, tables by fancy indices."""
    cells = fabric.weave.cells
    ends, picks = cells.shape
    psi0 = _angles(fabric)
    total = np.zeros((planes.HORIZON, size, size))
    split, thread = steepness(fabric), fabric.thread_list[0]
    horizon = np.zeros((planes.AZIMUTHS, size, size))
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
            part = planes.PARTS * top + 2 * (angle < 0) + (np.abs(angle) > split[top.astype(int)])
            total[planes.COVER] += seen
            for k in range(2 * planes.PARTS):
                mine = (part == k) & seen
                total[planes.SHARE + k] += mine
                total[planes.ANGLE + k] += np.where(mine, angle, 0.0)
                total[planes.ANGLE_2 + k] += np.where(mine, angle * angle, 0.0)
            for k, of_set in enumerate((~top & seen, top & seen)):
                for channel in range(3):
                    total[planes.TINT + 3 * k + channel] += of_set * thread.albedo[channel]
                total[planes.LOBE_2 + k] += np.where(of_set, narrow, seen)
            for k, value in enumerate((su, sv, su * su, sv * sv, su * sv)):
                total[planes.SLOPE + k] += value
            length = made.cloth.runs[i, j, 0, 1] * fabric.warp.pitch
            lift = made.cloth.half_thickness[0, 0]
            total[planes.HEIGHT] += (np.interp(s, *_heights(fabric)) * length + lift) * seen
            total[planes.FRESNEL] += seen * ((thread.ior - 1) / (thread.ior + 1)) ** 2
            at = np.degrees(angle) + 90.0
            low = np.clip(at.astype(int), 0, 179)
            values = reflected[top.astype(int), 0, low] * seen[..., None]
            total[planes.SURFACE] += values[..., 0]
            total[planes.FUZZ] += values[..., 2]
            for channel in range(3):
                total[planes.VOLUME + channel] += values[..., 1] * thread.albedo[channel]
            rows = np.clip((along * table.shape[3]).astype(int), 0, table.shape[3] - 1)
            columns = np.clip(((over - 0.5) / width + 0.5) * table.shape[4], 0, table.shape[4] - 1)
            found = table[i, j, 0, rows, columns.astype(int)] * seen[..., None]
            horizon += np.moveaxis(found, -1, 0)
    return np.concatenate((total, horizon)) / SIDE**2


def _angles(fabric: Fabric):  # type: ignore[no-untyped-def]
    curve = fabric.thread_list[0].curve
    x = np.asarray(curve.positions) / curve.positions[-1]
    return lambda s: np.interp(s, x, curve.angles)


def _heights(fabric: Fabric) -> tuple[np.ndarray, np.ndarray]:
    s = np.linspace(0, 1, 257)
    slope = -np.tan(_angles(fabric)(s))
    return s, np.concatenate(([0.0], np.cumsum(0.5 * (slope[1:] + slope[:-1]) / 256)))


def against_numpy() -> None:
    fabric = load("linen_plain")
    size, threads = 256, 448.0
    one = garments(square(fabric, threads))[0]
    made = recipe(fabric)
    sheet = sheets_of(one, (made,), {1001: (0, 0)}, size, 0)[0]
    step = np.abs(texel_step(sheet, 0))
    owner = np.zeros((size, size), np.int32)
    out = np.empty((planes.PLANES, size, size), np.float32)
    sums = np.empty(planes.PLANES, np.float32)

    def ours() -> None:
        m.texels(made, step, step, np.zeros(2), (0, 0), owner, 0, SIDE, sums, out)

    ours()
    seconds = [_timed(f) for f in (ours, lambda: plain_planes(made, fabric, step, size))]
    plain = plain_planes(made, fabric, step, size)
    close = float(np.abs(out.mean(axis=(1, 2)) - plain.mean(axis=(1, 2))).max())
    print(
        f"planes of {size} x {size} texels, {SIDE}x{SIDE} samples, 1 worker: {seconds[0]:.3f} s "
        f"plain NumPy {seconds[1]:.3f} s, ratio {seconds[1] / seconds[0]:.1f} "
        f"(means of the {planes.PLANES} planes differ by at most {close:.4f})"
    )


def _timed(function) -> float:  # type: ignore[no-untyped-def]
    best = np.inf
    for _ in range(3):
        began = time.process_time()
        function()
        best = min(best, time.process_time() - began)
    return best


def by_texels() -> None:
    fabric = load("linen_plain")
    binding = Binding(fabric=fabric, threads_per_uv=(300.0, 300.0))
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/square.obj"
        with open(path, "w") as stream:
            stream.write(
                "v 0 0 0\nv .1 0 0\nv .1 .1 0\nv 0 .1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
                "f 1/1 2/2 3/3 4/4\n"
            )
        bake(path, f"{folder}/warm", Settings(resolution=64), fabric=binding)
        for resolution in (512, 1024, 2048):
            began = time.process_time()
            bake(path, f"{folder}/{resolution}", Settings(resolution=resolution), fabric=binding)
            seconds = time.process_time() - began
            print(
                f"{resolution:5} x {resolution:<5} {seconds:7.2f} processor seconds, "
                f"{seconds / resolution**2 * 1e6:.2f} microseconds a texel, "
                f"peak {_peak():.2f} GB"
            )


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


def btf_curve() -> None:
    for name in ("linen_plain", "polyester_satin_charmeuse", "velvet"):
        for bound in (8.0, 4.0, 2.0, 1.0, 0.5):
            with tempfile.TemporaryDirectory() as folder:
                records = write_btf(load(name), Path(folder), FORMS, max_error=bound)
            for r in records:
                print(
                    f"{name:26} {r['form']:10} {r['megabytes']:6.2f} MB  rank {max(r['rank']):3}  "
                    f"delta E {r['delta_e']:.2f}, between directions {r['delta_e_between']:.2f}"
                )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--full", metavar="SCENE")
    parser.add_argument("--btf", action="store_true")
    options = parser.parse_args()
    against_numpy()
    by_texels()
    if options.full:
        full(options.full)
    if options.btf:
        btf_curve()

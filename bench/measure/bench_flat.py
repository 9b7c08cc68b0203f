"""Photographs of flat cloth fitted, rendered by the path tracer, and compared: FLIP, seconds.

    python bench/measure/bench_flat.py --photographs FOLDER [--pair NAME=WEAVE ...] [--spp 32]
    python bench/measure/bench_flat.py --known

FOLDER has NAME_R.png and NAME_T.png of [Tang2024]'s setup: camera at height 8 with a field of view
of 53 degrees, lamps at (0, 8, 8) and (0, 0, -9). FLIP is that of the render under the stated light,
of the photograph's mean, and of a tile of the photograph, repeated and relit as if matte. `--known`
fits cloth that the path tracer photographed, and prints errors.
"""

from __future__ import annotations

import argparse
import os
import time

import numpy as np

from fabricusd.fabric import FACETS, Fabric, TangentCurve, Thread, ThreadSet
from fabricusd.measure.flat.compare import compare
from fabricusd.measure.flat.fit import fit_flat
from fabricusd.measure.flat.photograph import Photograph, read_photograph
from fabricusd.measure.flat.scene import photograph_of, scene_of
from fabricusd.measure.flat.setup import Setup
from fabricusd.weaves import parse_weave

PAIRS = ("twill5=twill 2/1", "satin1=satin 5", "twill1=twill 3/1")
SETUP = Setup(light=(0.0, 1.0, 1.0), back_light=(0.0, 0.0, -1.125), view_angle=53.0)


def print_pair(folder: str, name: str, weave: str, spp: int) -> None:
    front = read_photograph(os.path.join(folder, f"{name}_R.png"))
    path = os.path.join(folder, f"{name}_T.png")
    behind = read_photograph(path) if os.path.exists(path) else None
    begun, busy = time.perf_counter(), time.process_time()
    flat = fit_flat(front, behind, SETUP, weave=weave)
    fitted, busy = time.perf_counter() - begun, time.process_time() - busy
    made = compare(flat, spp=spp)
    words = ", ".join(f"{key} {value:.3f}" for key, value in made.figures.items())
    print(f"{name}: {flat.lattice.weave.name}, pitch {flat.lattice.pitch[0]:.3g} x "
          f"{flat.lattice.pitch[1]:.3g} pixels; FLIP: {words}; delta E {made.delta_e:.2f}; fit "
          f"{fitted:.0f} s, {busy:.0f} s of processors", flush=True)  # fmt: skip


def known(weave: str, pitch: tuple[float, float], colors: tuple[tuple[float, ...], ...]) -> Fabric:
    made = parse_weave(weave).weave
    curve = TangentCurve(angles=(-0.35, 0.35))
    threads = {
        name: Thread(albedo=(c[0], c[1], c[2]), ior=1.5, isotropic=0.4, gamma_surface=0.25,
                     gamma_volume=0.5, curve=curve)
        for name, c in zip(("Warp", "Weft"), colors, strict=True)
    }  # fmt: skip
    share = made.warp_share
    return Fabric(
        name="Known", threads=threads, weave=made, model="conserving", surface_law=FACETS,
        warp=ThreadSet(sequence=(0,), coverage=0.96 * share),
        weft=ThreadSet(sequence=(1,), coverage=0.96 * (1 - share)),
    )  # fmt: skip


def print_known() -> None:
    rows = (
        ("twill 2/1 S", (7.3, 8.1), ((0.1, 0.15, 0.5), (0.7, 0.7, 0.65))),
        ("plain", (9.2, 9.9), ((0.6, 0.2, 0.15), (0.6, 0.2, 0.15))),
        ("satin 5 step 2", (6.6, 7.1), ((0.6, 0.5, 0.3), (0.6, 0.5, 0.3))),
    )
    for weave, pitch, colors in rows:
        fabric = known(weave, pitch, colors)
        shape = (384, 384)
        picture = photograph_of(
            scene_of(fabric, SETUP, shape, pitch=pitch, turn=0.02, gain=6.0), shape, spp=32
        )
        front = Photograph(name=weave, linear=np.clip(picture, 0.0, 1.0))
        flat = fit_flat(front, None, SETUP)
        made = compare(flat)
        found = [t.albedo for t in flat.fabric.thread_list]
        print(f"{weave}, {pitch} pixels: found {flat.lattice.weave.name}, "
              f"{flat.lattice.pitch[0]:.3f} x {flat.lattice.pitch[1]:.3f}, turn "
              f"{flat.lattice.turn:.3f} rad (truth .020); A x lamp over the truth "
              f"{np.round(np.array(found) * flat.gain / 6 / np.array(colors), 2).tolist()}; FLIP "
              f"{made.figures['render']:.3f}", flush=True)  # fmt: skip
        print("\n".join(f"    {line}" for line in flat.lines()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--photographs", metavar="FOLDER")
    parser.add_argument("--pair", nargs="+", default=PAIRS, metavar="NAME=WEAVE")
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--known", action="store_true")
    options = parser.parse_args()
    if options.known:
        print_known()
    if options.photographs:
        for pair in options.pair:
            name, _, weave = pair.partition("=")
            print_pair(options.photographs, name, weave, options.spp)


if __name__ == "__main__":
    main()

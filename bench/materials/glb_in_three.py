"""Compare the .glb in three.js with the reference path tracer.

    npm install --prefix build/three three
    python bench/materials/glb_in_three.py [--out FOLDER] [--presets NAME ...] [--subjects NAME ...]

The subjects are half a cylinder, on which nothing shadows anything, and a draped cloth. They stand
under one distant light and a uniform sky. fabricusd renders the fabric itself; three.js, in a
headless Chromium, draws the .glb of its baked look, with a shadow map but without the shadow that
the cloth throws on the sky's light, and without bounces. The script prints delta E 2000 over the
pixels that the cloth covers in both pictures, and writes the pictures side by side: the reference
on the left, three.js on the right. `--turn 90` turns the direction of the anisotropy, which must
make the figures worse. `--emission L` lets the cloth emit the radiance L, in place of the light of
the sky that comes through it, which three.js lacks.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import subprocess
import sys
import tempfile
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdLux

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "samples"))
sys.path.insert(0, str(HERE))

from blender_compare import CYLINDER, GARMENT, TOWARDS, cylinder, drape  # noqa: E402
from make_samples import camera, dress, look_at  # noqa: E402

from fabricusd.bake.bake import bake  # noqa: E402
from fabricusd.bake.job import Settings as BakeSettings  # noqa: E402
from fabricusd.images.files import read_exr_layers, write_png  # noqa: E402
from fabricusd.materials.materials import write_materials  # noqa: E402
from fabricusd.materials.recipes import Settings  # noqa: E402
from fabricusd.quality.pictures import difference  # noqa: E402
from fabricusd.reference.render import render  # noqa: E402
from fabricusd.schema import load  # noqa: E402
from fabricusd.srgb import srgb_encode  # noqa: E402

PRESETS = ("linen_plain", "polyester_satin_charmeuse", "cotton_poplin")
SIZE = (300, 200)
SUPERSAMPLE = 4
IRRADIANCE = 0.75 * math.pi
SKY = 0.25
"""Radiance of the sky. A white diffuser that faces the light has radiance 1."""


def make_scene(subject, preset, folder):
    path = folder / f"{subject.name}.{preset}.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    mesh = cylinder(stage) if subject is CYLINDER else drape(stage, folder)
    dress(stage, mesh, load(preset))
    sun = UsdLux.DistantLight.Define(stage, "/World/Sun")
    sun.CreateIntensityAttr(IRRADIANCE)
    sun.CreateAngleAttr(0.0)
    sun.AddTransformOp().Set(look_at(tuple(TOWARDS.tolist()), (0.0, 0.0, 0.0)))
    UsdLux.DomeLight.Define(stage, "/World/Sky").CreateIntensityAttr(SKY)
    camera(stage, subject.eye, subject.at, subject.focal_length)
    stage.GetRootLayer().Save()
    return path


def handler(served, got, finished):
    """Serves files by their names, and keeps what the page posts."""

    class Handler(SimpleHTTPRequestHandler):
        def translate_path(self, path):
            first, _, rest = path.lstrip("/").partition("/")
            place = served.get(first)
            return str(place / rest) if rest and place else str(place or "")

        def do_POST(self):
            body = self.rfile.read(int(self.headers["Content-Length"]))
            got[self.path] = body
            self.send_response(204)
            self.end_headers()
            if self.path in ("/done", "/failed"):
                finished.set()

        def log_message(self, *_):
            pass

    return Handler


def in_three(glb, subject, three, folder, turn=0.0, emission=0.0):
    """(h, w, 3) linear radiance, and (h, w) what share of each pixel the garment covers."""
    shot = folder / "shot.json"
    shot.write_text(
        json.dumps(
            {
                "size": SIZE, "supersample": SUPERSAMPLE, "sky": SKY, "irradiance": IRRADIANCE,
                "towards": TOWARDS.tolist(), "eye": subject.eye, "at": subject.at,
                "fov": math.degrees(2 * math.atan(12.0 / subject.focal_length)),
                "shadows": subject is not CYLINDER,
                "turn": math.radians(turn), "emission": emission,
            }
        )
    )  # fmt: skip
    served = {"three": three, "shot.json": shot, "garment.glb": glb,
              "page.html": HERE / "three_page.html"}  # fmt: skip
    got, finished = {}, threading.Event()
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler(served, got, finished))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        sys.exit("there is no chromium; install it")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        words = [
            browser, "--headless", "--no-sandbox", "--disable-quic", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-sync",
            "--use-angle=swiftshader", "--enable-unsafe-swiftshader", f"--user-data-dir={profile}",
            f"http://127.0.0.1:{server.server_port}/page.html",
        ]  # fmt: skip
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        good = finished.wait(300)
        process.terminate()
        process.wait()
    server.shutdown()
    if not good or "/failed" in got:
        sys.exit(f"three.js drew nothing: {got.get('/failed', b'no answer').decode()}")
    # WebGL's rows count from the bottom.
    color, cover = (_small(got[name])[::-1] for name in ("/picture", "/cover"))
    return color[..., :3], cover[..., 3], json.loads(got["/done"])


def _small(body):
    w, h = SIZE
    pixels = np.frombuffer(body, np.float32).reshape(h, SUPERSAMPLE, w, SUPERSAMPLE, 4)
    return pixels.mean(axis=(1, 3), dtype=np.float64).astype(np.float32)


def baked_glb(scene, folder):
    baked = folder / f"{scene.stem}.bake"
    if not (baked / "manifest.json").exists():
        bake(scene, baked, BakeSettings(resolution=512, fit=True))
    glb = folder / f"{scene.stem}.glb"
    write_materials(baked, settings=Settings(targets={"glb": glb}))
    return glb


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--three", type=Path, default=Path("build/three/node_modules/three"))
    parser.add_argument("--out", type=Path, default=Path("build/glb"))
    parser.add_argument("--presets", nargs="+", default=list(PRESETS))
    parser.add_argument("--subjects", nargs="+", default=["cylinder", "garment"])
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--turn", type=float, default=0.0, metavar="DEGREES")
    parser.add_argument("--emission", type=float, default=0.0, metavar="L")
    options = parser.parse_args()
    folder = options.out.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    print("| subject | preset | mean radiance | delta E mean | 95th |")
    print("|---|---|---|---|---|")
    rows = []
    for subject in (s for s in (CYLINDER, GARMENT) if s.name in options.subjects):
        for preset in options.presets:
            scene = make_scene(subject, preset, folder)
            truth = folder / f"{scene.stem}.exr"
            if not truth.exists():
                render(
                    scene, truth, width=SIZE[0], height=SIZE[1], spp=options.spp, level="far",
                    pixel_filter="box", aovs=("depth",),
                )  # fmt: skip
            layers, _ = read_exr_layers(truth)
            real = layers["beauty"][..., :3]
            glb = baked_glb(scene, folder)
            ours, cover, _ = in_three(
                glb, subject, options.three, folder, options.turn, options.emission
            )
            worn = (cover > 0.999) & np.isfinite(layers["depth"][..., 0])
            error = difference(ours[worn][None].copy(), real[worn][None].copy())
            mean = float(ours[worn].sum() / real[worn].sum() - 1.0)
            print(
                f"| {subject.name} | {preset} | {100 * mean:+.1f} % | {error.delta_e_mean:.2f} "
                f"| {error.delta_e_95:.2f} |",
                flush=True,
            )
            rows.append(np.concatenate((real, ours), axis=1))
            picture = srgb_encode(np.clip(rows[-1], 0.0, 1.0))
            codes = np.rint(picture * 255).astype(np.uint8)
            write_png(folder / f"{scene.stem}.beside.png", codes)


if __name__ == "__main__":
    main()

"""`fabricusd render`."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from fabricusd.cli.arguments.number import number
from fabricusd.cli.arguments.scheduler import add_scheduler
from fabricusd.cli.arguments.staging import add_staging, given_staging
from fabricusd.cli.arguments.units import add_units
from fabricusd.errors import FabricError, one_line
from fabricusd.ranges import RANGES, require_picture

if TYPE_CHECKING:
    from fabricusd.fabric import Fabric

EPILOG = """SCENE is a .usd, .usda, .usdc or .usdz file, or, with --fabric, an .obj, .glb, .gltf
or .ply file.

OUT.exr holds the beauty and every --aov; a .png of the beauty is written beside it. Ctrl-C stops
the render and keeps the samples taken so far.

example:
  fabricusd render garment.usda -o review.exr
  fabricusd render towel.obj --fabric silk_shot -o towel.exr --spp 256
  fabricusd render coat.usda -o turn.png --studio --frame Coat --orbit 24 --quick
  fabricusd render coat.usda -o sky.exr --dome sky.exr --dome-rotation 90 --background "#fff"
  fabricusd render shot.usda -o shot.exr --frames 1-24 --noise 0.02 --aov normal --aov depth"""

MOST_FRAMES = 100_000

MOST_TOLD = 50
"""Most meshes whose sizes a dry run prints."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to render, how well, and where to write it."""
    parser.add_argument("scene", metavar="SCENE", help="USD file, or a mesh file with --fabric")
    parser.add_argument(
        "out", metavar="OUT", nargs="?", help=".exr or .png file; -o OUT is the same"
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        help=".exr or .png file (no default)",
    )
    parser.add_argument(
        "--fabric",
        metavar="FILE[:/PRIM]",
        help="fabric file, draft or preset for meshes without a fabric (default: they are grey)",
    )
    add_units(parser)
    _add_picture(parser)
    _add_quality(parser)
    add_staging(parser)
    parser.add_argument("--seed", type=number("seed"), default=0, help="random seed (default: 0)")
    parser.add_argument(
        "--workers", type=number("workers"), metavar="N", help="CPU threads (default: all)"
    )
    add_scheduler(parser)
    parser.add_argument(
        "-n",
        "--dry-run",
        action="store_true",
        help="read and describe the scene, but render nothing",
    )
    parser.add_argument("--no-clobber", action="store_true", help="never replace a file")


def _add_picture(parser: argparse.ArgumentParser) -> None:
    """What the picture shows and holds."""
    parser.add_argument(
        "--camera",
        "-cam",
        metavar="NAME",
        help="prim path of the camera, or its name if no other has it (default: the first one)",
    )
    parser.add_argument(
        "--width",
        "--imageWidth",
        "-w",
        type=number("width"),
        default=960,
        help="pixels across, which the camera's horizontal aperture fills (default: 960)",
    )
    parser.add_argument(
        "--height", type=number("height"), help="pixels down (default: 9/16 of the width)"
    )
    parser.add_argument(
        "--aov",
        action="append",
        default=[],
        metavar="LAYER",
        help="also write this layer of the .exr, or 'all' (repeatable; default: beauty alone)",
    )
    parser.add_argument(
        "--frames",
        "-f",
        metavar="A-B",
        help="time codes to render: 7, 1-10, 1-10x2, 1:10, or a list of these (default: the first)",
    )
    parser.add_argument(
        "--exposure",
        type=number("exposure"),
        default=0.0,
        metavar="STOPS",
        help="exposure of the .png, in stops (default: 0)",
    )
    parser.add_argument(
        "--view",
        default="neutral",
        metavar="VIEW",
        help="how the .png shows the light: neutral (Khronos PBR Neutral: colours as they are, "
        "highlights rolled off), srgb (clipped), aces, or 'ocio CONFIG[:VIEW]' in quotes, with the "
        "file or name of an OpenColorIO config (default: neutral)",
    )


def _add_quality(parser: argparse.ArgumentParser) -> None:
    """How much work to spend, and at which level of detail."""
    preset = parser.add_mutually_exclusive_group()
    preset.add_argument(
        "--quick",
        action="store_true",
        help="--spp 16, denoised where Open Image Denoise is installed, unless told otherwise",
    )
    preset.add_argument(
        "--final", action="store_true", help="--noise 0.02 --spp 2048, unless told otherwise"
    )
    parser.add_argument(
        "--denoise",
        action="store_true",
        help="show the .png without noise, by Open Image Denoise; the .exr keeps the noisy beauty "
        "beside a layer 'denoised'",
    )
    parser.add_argument(
        "--spp", type=number("spp"), metavar="N", help="samples per pixel (default: 64)"
    )
    parser.add_argument(
        "--noise",
        type=number("noise"),
        metavar="E",
        help="stop sampling a pixel at this relative error, 0.05 for 5 %% (default: sample all "
        "alike)",
    )
    parser.add_argument(
        "--max-bounces",
        type=number("max_bounces"),
        default=4,
        metavar="N",
        help="most bounces at all surfaces but translucent cloth (default: 4)",
    )
    parser.add_argument(
        "--max-translucent",
        type=number("max_translucent"),
        metavar="N",
        help="most bounces at translucent cloth, which Russian roulette mostly ends before "
        "(default: 64; 0 with --max-bounces 0)",
    )
    parser.add_argument(
        "--level",
        choices=("auto", "far", "weave", "thread"),
        default="auto",
        help="detail of the cloth; auto: by the size of a pixel on it (default: auto)",
    )
    parser.add_argument(
        "--shadow",
        choices=("none", "peak", "horizon", "traced"),
        help="how threads shadow one another (default: horizon)",
    )
    parser.add_argument(
        "--max-error",
        type=number("max_error"),
        metavar="E",
        help="choose --shadow, --noise and the level for a relative error of at most this "
        "(default: as "
        "they are given)",
    )
    parser.add_argument(
        "--complexity", "-c", choices=("auto", "low", "medium", "high", "veryhigh"), default="auto",
        help="refinement of subdivision surfaces; low: none; auto: as fine as the picture shows "
        "(default: auto)",
    )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Render, and report what was left out."""
    _settle(options)
    require_picture(options.width, options.height)
    from fabricusd.images.view import parse_view
    from fabricusd.reference import AOVS, read_scene, render
    from fabricusd.scene.size import mesh_words
    from fabricusd.scene.staging import put

    options.view = parse_view(options.view)
    staging = given_staging(options)
    frames = None if options.frames is None else parse_frames(options.frames)
    output = Path(options.output)
    if options.no_clobber:
        _refuse_existing(output, tuple(range(1, options.orbit + 1)) or frames)
    fabric = None
    if options.fabric:
        from fabricusd.schema.anysource import load_any

        fabric, _ = load_any(options.fabric)
    _choose(options, fabric)
    if options.dry_run:
        scene = read_scene(
            options.scene,
            fabric=fabric,
            camera=options.camera,
            complexity=options.complexity,
            width=options.width,
            units=options.units,
            instanced=True,
        )
        put(staging, scene, options.width / options.height)
        _tell(scene.notes, options)
        triangles = sum(len(mesh.triangles) * mesh.times for mesh in scene.meshes)
        words = f"{len(scene.meshes)} meshes, {triangles} triangles, {len(scene.lights)} lights"
        if scene.instances:
            words += f", {scene.instances} instances"
        print(f"fabricusd: would render {words} to {output}", file=sys.stderr)
        for mesh in scene.meshes[:MOST_TOLD]:
            often = "" if mesh.placements is None else f", {mesh.times} times"
            print(f"fabricusd: {mesh.path}{often}: {mesh_words(scene, mesh)}", file=sys.stderr)
        if len(scene.meshes) > MOST_TOLD:
            print(f"fabricusd: and {len(scene.meshes) - MOST_TOLD} more", file=sys.stderr)
        return 0 if triangles else 1
    layers = tuple(AOVS) if "all" in options.aov else tuple(options.aov)
    bar, progress = _progress(options)
    try:
        result = render(
            options.scene, options.output, fabric=fabric, camera=options.camera,
            width=options.width, height=options.height, spp=options.spp, noise=options.noise,
            max_bounces=options.max_bounces, max_translucent=options.max_translucent,
            level=options.level, shadow=options.shadow, limits=options.limits, aovs=layers,
            frames=frames, seed=options.seed, workers=options.workers, exposure=options.exposure,
            view=options.view, staging=staging, denoise=options.denoise,
            complexity=options.complexity, units=options.units, scheduler=options.scheduler,
            progress=progress,
        )  # fmt: skip
    finally:
        bar()
    _tell(result.notes, options)
    if not options.quiet:
        rate = result.rays / max(result.seconds, 1e-9) / 1e6
        print(
            f"fabricusd: {', '.join(result.paths)}: {result.samples:.4g} samples per pixel, "
            f"{result.rays / 1e6:.3g} M rays in {result.seconds:.3g} s ({rate:.3g} M/s)",
            file=sys.stderr,
        )
    if not result.complete:
        print("fabricusd: interrupted; the samples taken so far are kept", file=sys.stderr)
        return 130
    too_noisy = options.noise and result.noise > options.noise
    return 1 if too_noisy or not result.met else 0


def _settle(options: argparse.Namespace) -> None:
    """Settle what one option says for another: OUT, the height, --quick and --final."""
    if options.out is not None and options.output is not None:
        raise FabricError("-o", f"names a second picture, '{options.output}'; give one")
    options.output = options.output or options.out
    if options.output is None:
        raise FabricError("OUT", "is missing; name the picture: -o OUT.exr")
    if options.height is None:
        options.height = max(round(options.width * 9 / 16), 1)
    if options.quick:
        from fabricusd.reference.denoise import has_denoiser

        options.spp = options.spp or (None if options.noise else 16)
        options.denoise = options.denoise or has_denoiser()
    if options.final and options.max_error is None:
        options.noise = options.noise or 0.02
        options.spp = options.spp or 2048


def _refuse_existing(output: Path, frames: tuple[float, ...] | None) -> None:
    from fabricusd.reference.picture_files import frame_files, written_files

    for _, target in frame_files(output, frames):
        for path in written_files(target):
            if os.path.lexists(path):
                raise FabricError(str(path), "exists; it must be a new name with --no-clobber")


def _choose(options: argparse.Namespace, fabric: Fabric | None) -> None:
    """Choose the settings that --max-error leaves open, and say why."""
    from fabricusd.appearance.weave.footprint import DEFAULT

    options.limits = DEFAULT
    if options.max_error is None:
        options.shadow = options.shadow or "horizon"
        return
    from fabricusd.reference import read_scene
    from fabricusd.reference.choice import choose_limits, choose_shadow, presets_in

    scene = read_scene(options.scene, fabric=fabric, camera=options.camera, units=options.units)
    if options.shadow is None:
        choice = choose_shadow(presets_in(scene), options.max_error)
        options.shadow = choice.method
        _tell([f"shadow {choice.method}: {choice.why}"], options)
    if options.level == "auto":
        options.limits, why = choose_limits(presets_in(scene), options.max_error)
        _tell([f"level auto, {why}"], options)
    if options.noise is None and options.spp is None:
        options.noise = options.max_error
        _tell([f"noise {options.noise:g}: that of the bound"], options)


def _tell(notes: object, options: argparse.Namespace) -> None:
    if not options.quiet:
        for note in notes:  # type: ignore[attr-defined]
            print(f"fabricusd: {note}", file=sys.stderr)


def _progress(
    options: argparse.Namespace,
) -> tuple[Callable[[], None], Callable[[float, float], None] | None]:
    """(function to call at the end, function to report progress to): a bar, on a terminal only."""
    if options.quiet or not sys.stderr.isatty():
        return (lambda: None), None
    from tqdm import tqdm

    bar = tqdm(total=1.0, bar_format="{percentage:3.0f} %|{bar}| {remaining} left", leave=False)

    def update(share: float, _seconds: float) -> None:
        bar.update(max(0.0, share - bar.n))

    return bar.close, update


def parse_frames(text: str) -> tuple[float, ...]:
    """`1-10`, `1-10x2`, `7`, `-5--1`, `1,4,9-12` -> time codes."""
    number = r"(-?[0-9.]+)"
    codes: list[float] = []
    for part in text.split(","):
        found = re.fullmatch(rf"{number}(?:[-:]{number})?(?:x([0-9.]+))?", part.strip())
        try:
            if found is None:
                raise ValueError
            first, last, step = found.groups()
            a, b, stride = float(first), float(last or first), float(step or 1)
        except ValueError:
            raise FabricError(
                "--frames", f"is '{text}'; write it as in 7, 1-10 or 1-10x2"
            ) from None
        for code in (a, b):
            RANGES["frame"].require(f"--frames '{one_line(text, 60)}':", code)
        if not (stride > 0 and b >= a):
            raise FabricError(
                "--frames", f"is '{text}'; a range must be ascending, with a step above 0"
            )
        if len(codes) + (b - a) / stride >= MOST_FRAMES:
            raise FabricError(
                "--frames", f"is '{text}'; it must be at most {MOST_FRAMES} frames in all"
            )
        codes += [a + k * stride for k in range(int((b - a) / stride + 1e-9) + 1)]
    return tuple(codes)

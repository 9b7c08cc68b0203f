"""`fabricusd preview`."""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fabricusd.cli.arguments.number import number
from fabricusd.cli.arguments.scheduler import add_scheduler
from fabricusd.cli.arguments.units import add_units
from fabricusd.errors import FabricError

if TYPE_CHECKING:
    from fabricusd.fabric import Fabric
    from fabricusd.preview.lights import Lights

SHAPES = ("cylinder", "sphere", "swatch", "drape", "scene")

EPILOG = """SOURCE is a preset, a draft, a USD file or FILE:/PRIM; or a scene: a USD file with
meshes, or with --fabric an .obj, .glb, .gltf or .ply file. The cloth lies over a black lining,
under one key light and a sky, and light does not bounce.

Without -o the picture is shown in the terminal, if that is kitty, iTerm2 or one that shows sixel;
elsewhere it is written to SOURCE.png.

example:
  fabricusd preview silk_shot
  fabricusd preview tartan.wif -o tartan.png --shape swatch
  fabricusd preview coat.usda -o coat.png --light -60 20
  fabricusd preview towel.obj --fabric wool_flannel -o towel.png
  fabricusd preview silk_shot --page silk.html --reference
  fabricusd preview denim.usda --serve --save denim.usda
  fabricusd preview --sheet linen_plain denim velvet -o sheet.png
  fabricusd preview --presets -o presets.png --scheduler tcp://10.0.0.1:8786"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to show, on which shape, in which light, and where."""
    parser.add_argument(
        "sources", metavar="SOURCE", nargs="*", help="preset, draft, fabric file or scene"
    )
    parser.add_argument(
        "-o", "--output", metavar="OUT",
        help=".png file (default: the terminal, or SOURCE.png in this folder)",
    )  # fmt: skip
    parser.add_argument(
        "--page", metavar="HTML",
        help="write one .html file that shows the cloth with WebGL2: turn it, move the light, "
        "change its threads (default: a picture)",
    )  # fmt: skip
    parser.add_argument(
        "--reference",
        action="store_true",
        help="with --page: put the path tracer's picture of the first view in, to wipe against",
    )
    parser.add_argument(
        "--serve", action="store_true",
        help="serve the page on this machine alone until Ctrl-C: it opens files, changes any "
        "thread and the weave, and path-traces what it shows",
    )  # fmt: skip
    parser.add_argument(
        "--save",
        metavar="USD",
        help="with --serve: the one file that the page may write, as variants of the fabric "
        "(default: it writes none)",
    )
    parser.add_argument(
        "--port", type=number("port"), default=0, metavar="N",
        help="with --serve: port of the server (default: a free one)",
    )  # fmt: skip
    parser.add_argument(
        "--shape", choices=SHAPES,
        help="what wears the cloth (default: the scene if SOURCE has meshes, else a cylinder)",
    )  # fmt: skip
    parser.add_argument(
        "--level", choices=("far", "weave", "thread"),
        help="detail of the cloth (default: thread on a swatch, far elsewhere)",
    )  # fmt: skip
    parser.add_argument(
        "--size", type=number("size"), metavar="N",
        help="pixels across; a scene is 9/16 as high (default: 512; 256 for tiles of a sheet)",
    )  # fmt: skip
    parser.add_argument(
        "--light", nargs=2, type=float, metavar=("AZIMUTH", "ELEVATION"), default=(-35.0, 40.0),
        help="where the key light stands, in degrees: to the right of the front, and above the "
        "horizon (default: -35 40)",
    )  # fmt: skip
    parser.add_argument(
        "--samples", type=number("samples"), metavar="N",
        help="samples per pixel (default: 8)",
    )  # fmt: skip
    parser.add_argument(
        "--exposure", type=number("exposure"), default=0.0, metavar="STOPS",
        help="exposure of the picture, in stops (default: 0)",
    )  # fmt: skip
    parser.add_argument(
        "--view", default="neutral", metavar="VIEW",
        help="how the picture shows the light: neutral, srgb, aces, or 'ocio CONFIG[:VIEW]', see "
        "'fabricusd help render' (default: neutral)",
    )  # fmt: skip
    many = parser.add_mutually_exclusive_group()
    many.add_argument(
        "--sheet", action="store_true", help="one sheet of all SOURCEs, as .png and .html"
    )
    many.add_argument("--presets", action="store_true", help="one sheet of all presets")
    many.add_argument(
        "--variants", action="store_true", help="one sheet of all variants of each SOURCE"
    )
    add_scheduler(parser)
    scene = parser.add_argument_group("scenes")
    scene.add_argument(
        "--fabric", metavar="FILE[:/PRIM]",
        help="fabric, draft or preset for meshes without a fabric (default: they are grey)",
    )  # fmt: skip
    scene.add_argument(
        "--camera", metavar="NAME", help="camera of the scene (default: the first one)"
    )
    add_units(scene)
    parser.add_argument("--no-clobber", action="store_true", help="never replace a file")


def run(options: argparse.Namespace) -> int:
    """Make one picture or one sheet."""
    from fabricusd.images.view import parse_view
    from fabricusd.preview.lights import Lights
    from fabricusd.ranges import RANGES

    begun = time.perf_counter()
    options.view = parse_view(options.view)
    azimuth, elevation = options.light
    RANGES["azimuth"].require("--light AZIMUTH", azimuth)
    RANGES["elevation"].require("--light ELEVATION", elevation)
    lights = Lights(azimuth=math.radians(azimuth), elevation=math.radians(elevation))
    _require_together(options)
    if options.sheet or options.presets or options.variants:
        return _sheet(options, lights, begun)
    if len(options.sources) != 1:
        given = "is missing" if not options.sources else f"is {len(options.sources)} names"
        raise FabricError("SOURCE", f"{given}; give one, or several with --sheet")
    if options.serve:
        return _serve(options, options.sources[0], lights)
    if options.page:
        return _page(options, options.sources[0], lights, begun)
    return _one(options, options.sources[0], lights, begun)


def _require_together(options: argparse.Namespace) -> None:
    """Refuse options that cannot be together, and those that would be ignored."""
    many = options.sheet or options.presets or options.variants
    for option, given in (("--page", options.page), ("--serve", options.serve)):
        if given and many:
            raise FabricError(option, "shows one SOURCE; it must stand without a sheet")
        if given and options.output:
            raise FabricError(
                "-o", f"names a picture, '{options.output}'; give it without {option}"
            )
    if options.page and options.serve:
        raise FabricError("--page", "writes a file; it must stand without --serve")
    for option, given, needed in (
        ("--reference", options.reference, "--page"), ("--save", options.save, "--serve"),
        ("--port", options.port, "--serve"),
    ):  # fmt: skip
        if given and not getattr(options, needed[2:]):
            raise FabricError(option, f"needs {needed}")
    if options.scheduler is not None and not many:
        raise FabricError(
            "--scheduler", "draws the tiles of a sheet: add --sheet, --presets or --variants"
        )


def _cloth(options: argparse.Namespace, source: str) -> tuple[Fabric, Any]:
    """(the fabric of SOURCE, the triangles that wear it if SOURCE is a scene, else None)."""
    if (options.shape or _shape_of(source)) != "scene":
        return _fabric(source, options), None
    from fabricusd.preview.scenes import shape_of_scene

    dressed = _fabric(options.fabric, options) if options.fabric else None
    found = shape_of_scene(source, dressed, options.camera, 1.0, options.units)
    for note in found.notes:
        _say(options, note)
    return found.cloth(source)


def _page(options: argparse.Namespace, source: str, lights: Lights, begun: float) -> int:
    """Write the page of a fabric, with the mesh of the scene if SOURCE is one."""
    from fabricusd.preview.page.make import page

    if Path(options.page).suffix.lower() != ".html":
        raise FabricError(options.page, "is not a name for the page; it must end in .html")
    _require_new(Path(options.page), options.no_clobber)
    fabric, mesh = _cloth(options, source)
    reference = None
    if options.reference:
        from fabricusd.preview.serve.traced import first_reference

        reference = first_reference(fabric, mesh, lights, options.samples)
    text = page(fabric, lights=lights, mesh=mesh, reference=reference).encode()
    _write(options.page, text)
    seconds = time.perf_counter() - begun
    _say(options, f"{options.page}: {len(text) / 1e6:.2g} MB in {seconds:.2g} s")
    return 0


def _serve(options: argparse.Namespace, source: str, lights: Lights) -> int:
    """Serve the page until the user stops it."""
    from fabricusd.preview.serve.server import Server
    from fabricusd.preview.serve.session import Session, require_file

    fabric, mesh = _cloth(options, source)
    save = Path(options.save) if options.save else None
    if save is not None:
        require_file(save, source, mesh is not None)
    session = Session(fabric, lights=lights, mesh=mesh, save=save)
    try:
        server = Server(session, options.port)
    except OSError as error:
        said = error.strerror or error
        raise FabricError("--port", f"is {options.port}, which cannot be used: {said}") from error
    # The address is what was asked for, so it goes to stdout.
    print(server.url, flush=True)
    _say(options, "open this address in a browser on this machine; Ctrl-C stops the server")
    try:
        server.serve_forever(poll_interval=0.2)
    finally:
        session.end()
        server.server_close()
    return 0


def _one(options: argparse.Namespace, source: str, lights: Lights, begun: float) -> int:
    """Make one picture, and show or write it."""
    from fabricusd.preview.png import png_bytes
    from fabricusd.preview.terminal import shown, terminal_protocol

    protocol = "" if options.output else terminal_protocol()
    name = Path(source.partition("{")[0].partition(":/")[0]).stem or "preview"
    output = options.output or (None if protocol else f"{name}.png")
    if output is not None:
        _require_png(output, options.no_clobber)
    shape = options.shape or _shape_of(source)
    picture = _scene(options, source, lights) if shape == "scene" else None
    if picture is None:
        fabric = _fabric(source, options)
        picture = _drawn(fabric, shape, options, lights, options.size or 512)
    pixels = picture.codes(options.exposure, options.view)
    png = png_bytes(pixels)
    if output is None:
        sys.stdout.write(shown(protocol, png, pixels))
    else:
        _write(output, png)
    where = output or "the terminal"
    size = f"{pixels.shape[1]} x {pixels.shape[0]} pixels"
    _say(options, f"{where}: {name} on a {shape}, {size} in {time.perf_counter() - begun:.2g} s")
    return 0 if picture.cover.any() else 1


def _drawn(
    fabric: Fabric, shape: str, options: argparse.Namespace, lights: Lights, size: int
) -> Any:
    from fabricusd.preview.picture import preview

    return preview(
        fabric, shape=shape, level=options.level, size=size, lights=lights, samples=options.samples
    )


def _scene(options: argparse.Namespace, source: str, lights: Lights) -> Any:
    """Picture of the scene in a file."""
    from fabricusd.preview.picture import SAMPLES, require, shaded
    from fabricusd.preview.scenes import shape_of_scene

    width = options.size or 512
    height = max(round(width * 9 / 16), 1)
    level = options.level or "far"
    require(level, width, width, options.samples)
    fabric = _fabric(options.fabric, options) if options.fabric else None
    found = shape_of_scene(source, fabric, options.camera, width / height, options.units)
    for note in found.notes:
        _say(options, note)
    return shaded(
        found.shape, found.st, found.camera, found.surfaces, level, (width, height), lights,
        options.samples or SAMPLES[level], found.material,
    )  # fmt: skip


def _sheet(options: argparse.Namespace, lights: Lights, begun: float) -> int:
    """Make a contact sheet, as a PNG and as an HTML file beside it."""
    from fabricusd.preview.fabrics import names_of_presets
    from fabricusd.preview.sheet import Drawing, sheet_html, sheet_png, tiles_of
    from fabricusd.run.cluster import cluster_or_threads

    sources = [*options.sources]
    if options.presets:
        if sources:
            raise FabricError("--presets", f"takes no SOURCE, but '{sources[0]}' is given")
        sources = names_of_presets()
    if not sources:
        raise FabricError("SOURCE", "is missing; name the fabrics of the sheet")
    if options.shape == "scene":
        raise FabricError("--shape scene", "cannot be on a sheet; it must be another shape")
    if options.variants:
        from fabricusd.schema.source import variant_sources

        sources = [one for source in sources for one in variant_sources(source)]
    output = Path(options.output or "sheet.png")
    page = output.with_suffix(".html")
    _require_png(str(output), options.no_clobber)
    _require_new(page, options.no_clobber)
    shape = options.shape or "cylinder"

    how = Drawing(
        shape=shape, level=options.level, size=options.size or 256, lights=lights,
        samples=options.samples,
    )  # fmt: skip
    named = [(source, _fabric(source, options)) for source in sources]
    with cluster_or_threads(options.scheduler, None) as cluster:
        tiles = tiles_of(
            named, how, lambda picture: picture.codes(options.exposure, options.view),
            1 if cluster is None else cluster,
        )  # fmt: skip
    for note in cluster.notes if cluster is not None else ():
        _say(options, note)
    _write(str(output), sheet_png(tiles))
    _write(str(page), sheet_html(f"{len(tiles)} fabrics on a {shape}", tiles).encode())
    seconds = time.perf_counter() - begun
    _say(options, f"{output}, {page}: {len(tiles)} fabrics in {seconds:.2g} s")
    return 0


def _fabric(source: str, options: argparse.Namespace) -> Fabric:
    from fabricusd.preview.fabrics import fabric_of

    fabric, notes = fabric_of(source)
    for note in notes:
        _say(options, f"{source}: {note}")
    return fabric


def _shape_of(source: str) -> str:
    """The shape for a source where none is asked for."""
    from fabricusd.preview.fabrics import is_preset

    suffix = Path(source).suffix.lower()
    if suffix in (".obj", ".glb", ".gltf", ".ply"):
        return "scene"
    if is_preset(source) or not suffix.startswith(".usd"):
        return "cylinder"
    from fabricusd.schema.source import holds

    return "scene" if holds(source, "Mesh") else "cylinder"


def _require_png(output: str, no_clobber: bool) -> None:
    if Path(output).suffix.lower() != ".png":
        raise FabricError(output, "is not a name for the picture; it must end in .png")
    _require_new(Path(output), no_clobber)


def _require_new(path: Path, no_clobber: bool) -> None:
    """Refuse now what could not be written when the picture is done."""
    from fabricusd.files import require_writable

    if no_clobber and os.path.lexists(path):
        raise FabricError(str(path), "exists; it must be a new name with --no-clobber")
    require_writable(path)


def _write(output: str, data: bytes) -> None:
    from fabricusd.files import whole_file

    with whole_file(output) as temporary:
        temporary.write_bytes(data)


def _say(options: argparse.Namespace, line: str) -> None:
    if not options.quiet:
        print(f"fabricusd: {line}", file=sys.stderr)

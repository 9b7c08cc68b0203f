"""`fabricusd measure`."""

from __future__ import annotations

import argparse
import sys

from fabricusd.cli.arguments.fitting import add_fitting, deliver, fitted, require_outputs, tell
from fabricusd.cli.arguments.thread import named_thread
from fabricusd.errors import FabricError

EPILOG = """DIR holds raw frames and manifest.json. Frames are TIFF, PNG or PGM of 8 to 16 bits, one
code per site, or DNG and CR2 with the extra 'raw'. The manifest states bits, colour filter,
exposures and angles: see docs/measurement.md. A frame that cannot be used is named and left out.

example:
  fabricusd measure --simulate shoot --thread thread_rayon_spun --design coarse
  fabricusd measure shoot -o rayon.usda --lobes lobes.csv --plots plots
  fabricusd measure shoot --lobes printed.csv --hdr thesis --background zero"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The folder or what is simulated, how frames are processed, and where to write."""
    parser.add_argument("folder", metavar="DIR", nargs="?", help="folder of photographs to measure")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help=".usda, .usdc or .usd file for the fitted thread (default: none)",
    )
    parser.add_argument(
        "--lobes",
        metavar="FILE",
        help="write the lobes as a table, .csv or .npz; without -o nothing is fitted (default: "
        "none)",
    )
    parser.add_argument(
        "--hdr",
        choices=["counts", "thesis"],
        default="counts",
        help="how exposures are merged: all that are not saturated, or eq. 3.3 of the thesis as "
        "printed, which loses dim light (default: counts)",
    )
    parser.add_argument(
        "--background",
        choices=["sides", "zero"],
        default="sides",
        help="subtract the mean beside the thread, or set dim pixels to zero as the thesis does "
        "(default: sides)",
    )
    add_fitting(parser)
    parser.add_argument(
        "-n", "--dry-run", action="store_true", help="check the manifest, but measure nothing"
    )
    simulated = parser.add_argument_group("a simulated gantry")
    simulated.add_argument(
        "--simulate",
        metavar="DIR",
        help="photograph a thread whose scattering is known, into this new folder (default: "
        "measure photographs)",
    )
    simulated.add_argument(
        "--thread",
        metavar="FABRIC[:THREAD]",
        help="the thread to photograph, of a fabric file or a preset (default: thread_rayon_spun)",
    )
    simulated.add_argument(
        "--bits",
        choices=["8", "10", "12", "14", "16"],
        help="bits of a code of the simulated camera (default: 12)",
    )
    simulated.add_argument(
        "--design",
        choices=["slice", "incidence", "half", "coarse"],
        help="where light and camera stand: five incidences in the plane, one, the half sphere "
        "(53,000 frames), or a few to try with (default: slice)",
    )


def run(options: argparse.Namespace) -> int:
    """Simulate, or measure and fit."""
    if options.simulate is not None:
        return _simulate(options)
    for option in ("thread", "bits", "design"):
        if getattr(options, option) is not None:
            raise FabricError(f"--{option}", "can only be used with --simulate")
    if not options.folder:
        raise FabricError("DIR", "is missing; name a folder of photographs, or use --simulate")
    if options.dry_run:
        from fabricusd.measure.capture.manifest import read_manifest

        manifest = read_manifest(options.folder)
        _notes(manifest.notes, options)
        print(f"{len(manifest.shots)} frames, {len(manifest.views())} views")
        return 0
    if options.output is None and options.lobes is None:
        raise FabricError(
            "-o", "is missing; give -o for the thread, --lobes for the lobes, or both"
        )
    for option in ("plots", "report", "scheduler"):
        if options.output is None and getattr(options, option):
            raise FabricError(f"--{option}", "needs a fit: give -o too")
    require_outputs(options)
    return _measure(options)


def _measure(options: argparse.Namespace) -> int:
    from fabricusd.measure import measure, write_lobes
    from fabricusd.measure.lobes import described

    made = measure(
        options.folder, hdr=options.hdr, background=options.background, workers=options.workers
    )
    tell(made.lobes, options)
    if not options.quiet:
        print(
            f"fabricusd: {made.captures} frames; {described(made.lobes)}; {made.skipped} left out",
            file=sys.stderr,
        )
    if options.output is None:
        write_lobes(made.lobes, options.lobes, clobber=not options.no_clobber)
        return 0
    fits = fitted(made.lobes, options)
    if options.lobes is not None:
        write_lobes(made.lobes, options.lobes, clobber=not options.no_clobber)
    deliver(made.lobes, fits, options.folder, options)
    return 0


def _simulate(options: argparse.Namespace) -> int:
    from fabricusd.measure.gantry.camera import Camera
    from fabricusd.measure.gantry.simulate import Shoot, require_empty, simulate

    for option in ("folder", "output", "lobes", "plots", "report", "scheduler"):
        if getattr(options, option):
            name = "DIR" if option == "folder" else f"--{option}"
            raise FabricError(name, "cannot be used with --simulate; measure in a second command")
    text = options.thread or "thread_rayon_spun"
    fabric, name = named_thread(text)
    if options.dry_run:
        require_empty(options.simulate)
        return 0
    thread = fabric.threads[name]
    count = simulate(
        thread,
        options.simulate,
        camera=Camera(bits=int(options.bits or 12)),
        shoot=Shoot(design=options.design or "slice"),
        name=fabric.name,
        model=fabric.model_of(thread),
        seed=options.seed,
        workers=options.workers,
    )
    if not options.quiet:
        print(f"fabricusd: wrote {count} frames to {options.simulate}", file=sys.stderr)
    return 0


def _notes(notes: tuple[str, ...], options: argparse.Namespace) -> None:
    if not options.quiet:
        for note in notes:
            print(f"fabricusd: {note}", file=sys.stderr)

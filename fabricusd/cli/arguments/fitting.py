"""The options of a fit of lobes, and what is done with them: for `measure` and `fit`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from fabricusd.cli.arguments.number import number
from fabricusd.cli.arguments.scheduler import add_scheduler
from fabricusd.errors import FabricError

if TYPE_CHECKING:
    from fabricusd.measure import Fitted, Lobes


def add_fitting(parser: argparse.ArgumentParser) -> None:
    """Models, nuisances, seed, and what is written."""
    parser.add_argument(
        "--model",
        choices=["thesis", "microcylinder", "conserving", "all"],
        default="microcylinder",
        help="scattering model of the thread; all fits each, and writes the one with the least "
        "chi2 (default: microcylinder)",
    )
    parser.add_argument(
        "--gain",
        choices=["fixed", "free"],
        help="whether a factor common to all lobes is known (default: fixed where the lobes are "
        "absolute, free where they are relative)",
    )
    parser.add_argument(
        "--offset", action="store_true", help="fit stray light too, a constant per channel"
    )
    parser.add_argument(
        "--lean", action="store_true", help="fit a lean of the thread in the light's plane too"
    )
    parser.add_argument(
        "--seed",
        type=number("seed"),
        default=0,
        metavar="N",
        help="seed of the starts, and of a simulation's noise (default: 0)",
    )
    parser.add_argument(
        "--workers",
        type=number("workers"),
        metavar="N",
        help="worker threads (default: one per processor)",
    )
    add_scheduler(parser)
    parser.add_argument(
        "--plots",
        metavar="DIR",
        help="write plots of measured and fitted lobes into this folder (default: none)",
    )
    parser.add_argument(
        "--interpolation",
        choices=["ratio", "bilinear", "thesis"],
        default="ratio",
        help="what is drawn between views of a half sphere: by the ratio to the fitted thread, "
        "bilinearly, or by eq. 3.8 of the thesis, which blurs (default: ratio)",
    )
    parser.add_argument(
        "--report",
        metavar="JSON",
        help="write the fits, their intervals and notes as JSON (default: print them only)",
    )
    parser.add_argument("--no-clobber", action="store_true", help="never replace a file")


def require_outputs(options: argparse.Namespace) -> None:
    """Raise now for what could not be written when the work is done."""
    from fabricusd.files import require_writable
    from fabricusd.schema.write import require_layer_name

    if options.output is not None:
        require_layer_name(options.output)
    tables = getattr(options, "lobes", None)
    if tables is not None and not tables.lower().endswith((".csv", ".npz")):
        raise FabricError(tables, "is not a table of lobes; it must end in .csv or .npz")
    for path in (options.output, tables, options.report):
        if path is not None:
            require_writable(path, clobber=not options.no_clobber)
    if options.plots is not None:
        from fabricusd.measure.plots.draw import require_folder

        require_folder(options.plots)


def fitted(lobes: Lobes, options: argparse.Namespace) -> list[Fitted]:
    """The fits that the options ask for, the best first."""
    from fabricusd.fabric import MODELS
    from fabricusd.measure import fit_thread
    from fabricusd.run.cluster import cluster_or_threads

    gain = None if options.gain is None else options.gain == "free"
    with cluster_or_threads(options.scheduler, options.workers) as cluster:
        fits = [
            fit_thread(
                lobes, model, gain=gain, offset=options.offset, lean=options.lean,
                seed=options.seed, workers=options.workers, scheduler=cluster,
            )
            for model in (MODELS if options.model == "all" else (options.model,))
        ]  # fmt: skip
    return sorted(fits, key=lambda fit: fit.chi2)


def deliver(lobes: Lobes, fits: list[Fitted], source: str, options: argparse.Namespace) -> None:
    """Print the fits, and write the thread, the report and the plots that were asked for."""
    from fabricusd.files import write_json
    from fabricusd.measure.thread_file import save_thread
    from fabricusd.measure.words import described_words

    clobber = not options.no_clobber
    for fit in fits:
        print("\n".join(fit.lines()))
    for line in described_words(fits[0].thread, fits[0].model):
        print(line)
    if options.output is not None:
        save_thread(lobes, fits[0], options.output, source=source, clobber=clobber)
    if options.report is not None:
        write_json(
            Path(options.report),
            {
                "name": lobes.name, "views": len(lobes), "absolute": lobes.absolute,
                "notes": list(lobes.notes), "fits": [fit.as_json() for fit in fits],
            },
        )  # fmt: skip
    written = [path for path in (options.output, options.report) if path is not None]
    if options.plots is not None:
        from fabricusd.measure.plots.draw import draw_all

        written += [
            str(path)
            for path in draw_all(lobes, fits[0], options.plots, method=options.interpolation)
        ]
    if options.verbose:
        for path in written:
            print(f"fabricusd: wrote {path}", file=sys.stderr)


def tell(lobes: Lobes, options: argparse.Namespace) -> None:
    """Print the notes of a table of lobes, one a line, unless it is to be quiet."""
    if not options.quiet:
        for note in lobes.notes:
            print(f"fabricusd: {note}", file=sys.stderr)

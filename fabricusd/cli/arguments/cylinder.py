"""The options of a fit of cloth on cylinders, and what is done with them."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from fabricusd.errors import FabricError

ONLY_CYLINDER = ("setup", "fabric", "coverage")
"""Options that mean nothing without --cylinder."""


def add_cylinder(parser: argparse.ArgumentParser) -> None:
    """Where cylinders stand, and what is woven on them."""
    group = parser.add_argument_group("cloth on cylinders, with --cylinder")
    group.add_argument(
        "--setup",
        metavar="JSON",
        help="where camera, light and cylinders stand, see docs/cylinder_fit.md (no default)",
    )
    group.add_argument(
        "--fabric",
        metavar="FABRIC",
        help="fabric file or preset whose weave, coverage, curves and model are taken; its lobes "
        "and colours are not (no default)",
    )
    group.add_argument(
        "--coverage",
        action="store_true",
        default=None,
        help="fit the share that warp and weft cover too (default: that of the fabric)",
    )


def refuse_cylinder_options(options: argparse.Namespace) -> None:
    """Raise FabricError for options of --cylinder without it."""
    for name in ONLY_CYLINDER:
        if getattr(options, name) is not None:
            raise FabricError(f"--{name}", "can only be used with --cylinder")


def run_cylinder(options: argparse.Namespace) -> int:
    """Fit the threads of cloth on cylinders, print what is known of them, and write the fabric."""
    from fabricusd.files import require_writable, write_json
    from fabricusd.measure.cylinder.fit import fit_cylinders
    from fabricusd.measure.cylinder.model import require_template
    from fabricusd.measure.cylinder.profile import read_profiles
    from fabricusd.measure.cylinder.setup import read_stand
    from fabricusd.measure.estimates_file import save_measured
    from fabricusd.schema.anysource import load_any
    from fabricusd.schema.write import require_layer_name

    for name in ("setup", "fabric"):
        if not getattr(options, name):
            what = "where do camera, light and cylinders stand?" if name == "setup" else (
                "what is woven? Name a fabric file or a preset"
            )  # fmt: skip
            raise FabricError(f"--{name}", f"is missing; {what}")
    if options.output is not None:
        require_layer_name(options.output)
    for path in (options.output, options.report):
        if path is not None:
            require_writable(path, clobber=not options.no_clobber)
    stand = read_stand(options.setup, len(options.cylinder))
    fabric, _ = load_any(options.fabric)
    template = require_template(fabric, options.fabric)
    profiles = read_profiles(options.cylinder, stand)
    if options.dry_run:
        for p in profiles:
            print(f"{p.cylinder.name}: {len(p.light)} places, {p.cylinder.use}")
        return 0
    made = fit_cylinders(
        template, profiles, irradiance=stand.irradiance, coverage=bool(options.coverage),
        seed=options.seed, workers=options.workers, scheduler=options.scheduler,
    )  # fmt: skip
    print("\n".join(made.lines()))
    if options.output is not None:
        said = ", ".join(f"'{path}'" for path in options.cylinder)
        text = "\n".join([f"Fitted by fabricusd to {said}:", *(x.strip() for x in made.lines())])
        save_measured(
            replace(made.fabric, documentation=text),
            {e.label: (e.value, e.low, e.high, e.unit, "fitted") for e in made.estimates.values()},
            options.output,
            photograph=said,
            notes=made.notes,
            clobber=not options.no_clobber,
        )
    if options.report is not None:
        write_json(Path(options.report), made.as_json())
    if options.verbose:
        for path in (options.output, options.report):
            if path is not None:
                print(f"fabricusd: wrote {path}", file=sys.stderr)
    return 0

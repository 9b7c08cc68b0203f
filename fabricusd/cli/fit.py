"""`fabricusd fit`."""

from __future__ import annotations

import argparse

from fabricusd.cli.arguments.cylinder import (
    add_cylinder,
    refuse_cylinder_options,
    run_cylinder,
)
from fabricusd.cli.arguments.fitting import add_fitting, deliver, fitted, require_outputs, tell
from fabricusd.cli.arguments.flat import add_flat, refuse_flat_options, run_flat
from fabricusd.errors import FabricError

EPILOG = """LOBES is a table that 'measure' wrote, or any CSV with the columns theta_i, theta_o and
phi_d (degrees, inclinations from the thread's normal plane) and f_r, f_g and f_b (1/sr, without the
cosine). The columns sigma_r, sigma_g and sigma_b are their standard deviations.

--flat fits a whole fabric to photographs of flat cloth: weave, densities, colours, lobes, gap. Each
number has an interval and a source. --cylinder fits the threads of cloth whose weave is known. See
docs/measurement.md, docs/flat_cloth.md and docs/cylinder_fit.md.

Printed are chi2 per degree of freedom and 95 % intervals. Parameters that the views do not tell
apart are said to be, with the product that the views do tell.

example:
  fabricusd fit lobes.csv -o thread.usda
  fabricusd fit lobes.csv --model all --plots plots --report fit.json
  fabricusd fit --flat front.png behind.png --weave "twill 2/1" --light 0 1 1 \\
      --back-light 0 0 -1.1 --cloth-width 6 -o cloth.usda --page cloth.html
  fabricusd fit --cylinder wraps.exr --setup wraps.json --fabric linen_plain -o fitted.usda"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The table, how it is fitted, and where to write."""
    parser.add_argument("table", metavar="LOBES", nargs="?", help="table of lobes, .csv or .npz")
    parser.add_argument(
        "--flat",
        nargs="+",
        metavar="PHOTO",
        help="fit a fabric to a photograph of flat cloth lit from before, and to a second one lit "
        "from behind (default: fit a thread to LOBES)",
    )
    parser.add_argument(
        "--cylinder",
        nargs="+",
        metavar="PHOTO",
        help="fit the threads of a --fabric to photographs of it on cylinders, whose place --setup "
        "states (default: fit a thread to LOBES)",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help=".usda, .usdc or .usd file for the fitted thread (default: print only)",
    )
    add_fitting(parser)
    add_flat(parser)
    add_cylinder(parser)
    parser.add_argument(
        "-n", "--dry-run", action="store_true", help="read the table, but fit and write nothing"
    )


def run(options: argparse.Namespace) -> int:
    """Fit a thread, print what is known of it, and write it."""
    if options.flat is None:
        refuse_flat_options(options)
    if options.cylinder is None:
        refuse_cylinder_options(options)
    for name in ("flat", "cylinder"):
        if getattr(options, name) is not None:
            if options.table:
                raise FabricError(f"--{name}", f"cannot be used with the table '{options.table}'")
            _refuse_options_of_lobes(options, name)
    if options.flat is not None:
        if options.cylinder is not None:
            raise FabricError("--flat", "cannot be used with --cylinder")
        if options.scheduler is not None:
            raise FabricError("--scheduler", "cannot be used with --flat, which is one short fit")
        return run_flat(options)
    if options.cylinder is not None:
        return run_cylinder(options)
    from fabricusd.measure.lobes import described, gaps, read_lobes

    if not options.table:
        raise FabricError("LOBES", "is missing; name a table of lobes, or photographs with --flat")
    lobes = read_lobes(options.table)
    tell(lobes, options)
    if options.dry_run:
        print(described(lobes))
        for gap in gaps(lobes):
            print(gap)
        return 0
    require_outputs(options)
    deliver(lobes, fitted(lobes, options), options.table, options)
    return 0


def _refuse_options_of_lobes(options: argparse.Namespace, name: str) -> None:
    """Raise FabricError for what only a fit of lobes understands."""
    for option in ("gain", "plots"):
        if getattr(options, option) is not None:
            raise FabricError(f"--{option}", f"cannot be used with --{name}")
    for option in ("offset", "lean"):
        if getattr(options, option):
            raise FabricError(f"--{option}", f"cannot be used with --{name}")

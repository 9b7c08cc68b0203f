"""`fabricusd compare`."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict

from fabricusd.cli.arguments.number import number

EPILOG = """A is compared with the reference B. EXR holds radiance, other formats display colours.

exit status: 0 done, 1 the difference is above a --max bound, 2 a picture cannot be read

example:
  fabricusd compare new.exr golden.exr -o difference.png
  fabricusd compare blender.png reference.png --max-error 2"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Two pictures, what to write, and which difference to allow."""
    parser.add_argument("a", metavar="A", help="picture")
    parser.add_argument("b", metavar="B", help="reference")
    parser.add_argument(
        "-o", "--output", metavar="PNG", help="write a map of where they differ, by FLIP"
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.add_argument(
        "--max-flip",
        type=number("difference"),
        metavar="X",
        help="exit with status 1 if the mean FLIP is above this",
    )
    parser.add_argument(
        "--max-error",
        type=number("difference"),
        metavar="DE",
        help="exit with status 1 if the mean delta E 2000 is above this",
    )


def run(options: argparse.Namespace) -> int:
    """Print the figures, draw the map, and judge the difference by the bounds."""
    from fabricusd.images.files import read_image, write_png
    from fabricusd.quality.pictures import difference, flip_map, heat

    high_range = options.a.lower().endswith(".exr") and options.b.lower().endswith(".exr")
    a, b = read_image(options.a), read_image(options.b)
    found = difference(a, b, high_range=high_range)
    if options.json:
        print(json.dumps(asdict(found), indent=2))
    else:
        print(f"RMSE          {found.rmse:.6g}")
        print(f"relative MSE  {found.relative_mse:.6g}")
        print(f"FLIP          {found.flip:.4f}")
        print(f"delta E 2000  {found.delta_e_mean:.3f} mean, {found.delta_e_95:.3f} at 95 %")
    if found.not_finite:
        print(
            f"fabricusd: {found.not_finite} pixels are not finite and are left out",
            file=sys.stderr,
        )
    if options.output:
        write_png(options.output, heat(flip_map(a, b, high_range=high_range)))
    over = (options.max_flip is not None and found.flip > options.max_flip) or (
        options.max_error is not None and found.delta_e_mean > options.max_error
    )
    return 1 if over else 0

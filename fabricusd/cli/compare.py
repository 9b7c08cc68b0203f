"""`fabricusd compare`."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING

from fabricusd.cli.arguments.number import number
from fabricusd.errors import FabricError

if TYPE_CHECKING:
    from fabricusd.quality.noise import NoiseTest

EPILOG = """A is compared with the reference B. EXR holds radiance, other formats display colours.

If both pictures are EXRs with a layer 'variance' (render --aov variance), a z-test says whether
their difference is larger than their noise. Render them with different --seed.

exit status: 0 done, 1 the difference is above a bound, 2 a picture cannot be read

example:
  fabricusd compare new.exr golden.exr -o difference.png
  fabricusd compare blender.png reference.png --max-error 2
  fabricusd compare new.exr golden.exr --significance 0.001"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Two pictures, what to write, and which difference to allow."""
    parser.add_argument("a", metavar="A", help="picture")
    parser.add_argument("b", metavar="B", help="reference")
    parser.add_argument(
        "-o",
        "--output",
        metavar="PNG",
        help="write a map of where they differ, by FLIP, with its scale (default: none)",
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.add_argument(
        "--max-flip",
        type=number("difference"),
        metavar="X",
        help="exit with status 1 if the mean FLIP, 0 to 1, is above this (default: no bound)",
    )
    parser.add_argument(
        "--max-error",
        type=number("difference"),
        metavar="DE",
        help="exit with status 1 if the mean delta E 2000 is above this (default: no bound)",
    )
    parser.add_argument(
        "--significance",
        type=number("significance"),
        metavar="P",
        help="exit with status 1 if noise alone makes such a difference with a probability below "
        "this (default: no bound); both pictures need a layer 'variance'",
    )


def run(options: argparse.Namespace) -> int:
    """Print the figures, draw the map, and judge the difference by the bounds."""
    from fabricusd.images.files import parts_of, read_image, write_png
    from fabricusd.quality.pictures import difference, flip_map

    high_range = options.a.lower().endswith(".exr") and options.b.lower().endswith(".exr")
    a, b = read_image(options.a), read_image(options.b)
    for name in (options.a, options.b):
        parts = parts_of(name)
        if len(parts) > 1:
            _say(f"{name}: has {len(parts)} parts; the first, '{parts[0]}', is compared", options)
    found = difference(a, b, high_range=high_range)
    tested = _noise(options) if high_range else None
    if options.significance is not None and tested is None:
        raise FabricError(
            "--significance", "needs two EXRs with a layer 'variance'; render with --aov variance"
        )
    if options.json:
        noise = None if tested is None else asdict(tested)
        print(json.dumps({**asdict(found), "noise": noise}, indent=2))
    else:
        print(f"RMSE          {found.rmse:.6g}")
        print(f"relative MSE  {found.relative_mse:.6g}")
        print(f"FLIP          {found.flip:.4f}")
        print(f"delta E 2000  {found.delta_e_mean:.3f} mean, {found.delta_e_95:.3f} at 95 %")
        if tested is not None:
            print(f"noise         {_in_words(tested)}")
    if found.not_finite:
        print(
            f"fabricusd: {found.not_finite} pixels are not finite and are left out",
            file=sys.stderr,
        )
    if options.output:
        from fabricusd.quality.scale import with_scale

        differing = flip_map(a, b, high_range=high_range)
        title = f"FLIP; mean {found.flip:.3g}; 0: none seen"
        write_png(options.output, with_scale(differing, title))
    over = (options.max_flip is not None and found.flip > options.max_flip) or (
        options.max_error is not None and found.delta_e_mean > options.max_error
    )
    beyond = options.significance is not None and tested is not None and tested.larger
    return 1 if over or beyond else 0


def _noise(options: argparse.Namespace) -> NoiseTest | None:
    """The z-test of both pictures; None if either has no usable layer `variance`."""
    from fabricusd.images.files import read_exr_layers
    from fabricusd.quality.noise import SIGNIFICANCE, noise_test

    (a, about_a), (b, about_b) = read_exr_layers(options.a), read_exr_layers(options.b)
    if not all({"beauty", "variance"} <= set(layers) for layers in (a, b)):
        return None
    for name, layers in ((options.a, a), (options.b, b)):
        if not layers["variance"].any():
            _say(
                f"{name}: the layer 'variance' is 0 everywhere; it takes at least 2 samples",
                options,
            )
            return None
    seed = about_a.get("fabricusd:seed")
    if seed is not None and seed == about_b.get("fabricusd:seed"):
        _say(
            f"both pictures have the seed {seed}: their noise is alike, and the z-test may miss a "
            "difference; render one of them with another --seed",
            options,
        )
    return noise_test(
        a["beauty"][..., :3], a["variance"], b["beauty"][..., :3], b["variance"],
        options.significance or SIGNIFICANCE,
    )  # fmt: skip


def _in_words(tested: NoiseTest) -> str:
    if not tested.larger:
        return f"p {tested.p:.2g}: noise may explain the difference"
    x, y = tested.pixel
    return f"p {tested.p:.2g}: the difference is larger than the noise, most at pixel ({x}, {y})"


def _say(line: str, options: argparse.Namespace) -> None:
    if not options.quiet:
        print(f"fabricusd: {line}", file=sys.stderr)

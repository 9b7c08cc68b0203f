"""Render the pictures of the samples for docs/path_tracer.md.

python docs/make_pictures.py [--spp N]"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from fabricusd.images.files import write_png
from fabricusd.images.view import encode
from fabricusd.reference import render

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "samples"))

SIZES = {
    "cylinders": (432, 240), "skirt": (288, 384), "drape": (432, 324),
    "curtain": (288, 216), "lit_skirt": (180, 240), "lit_drape": (240, 180),
}  # fmt: skip


def main() -> None:
    """Render the pictures that are named, or all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(SIZES))
    parser.add_argument("--spp", type=int, default=96)
    options = parser.parse_args()
    from lit_from_behind import make_curtain, make_lit_drape, make_lit_skirt
    from make_samples import make_cylinders, make_drape, make_skirt

    made = {
        "cylinders": make_cylinders, "skirt": make_skirt, "drape": make_drape,
        "curtain": make_curtain, "lit_skirt": make_lit_skirt, "lit_drape": make_lit_drape,
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        for name in options.names:
            width, height = SIZES[name]
            scene = made[name](Path(folder))
            result = render(scene, width=width, height=height, spp=options.spp)
            target = HERE / "images" / f"sample_{name}.png"
            write_png(target, encode(result.layers["beauty"][..., :3], 0.0))
            print(f"{target}: {result.samples:.0f} samples, {result.seconds:.1f} s")


if __name__ == "__main__":
    main()

"""What the mean of 2 x 2 texels, as tools make mip levels, costs the maps of a bake.

    python bench/materials/mip_levels.py BAKE [--side 64]

For each map, the level of `--side` texels in the file against means of the finest level: the
largest and the mean difference; of `normal` and `tangent`, the mean angle in degrees. A bake's own
levels are those of the threads' moments.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from fabricusd.images.files import read_mip_level
from fabricusd.materials.bake_folder import read_bake_folder

DIRECTIONS = {"normal": 1.0, "tangent": 0.0}
"""Maps of directions, and whether their sign counts."""


def unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bake", type=Path)
    parser.add_argument("--side", type=int, default=64)
    options = parser.parse_args()
    print("| map | finest level | mean difference | largest |")
    print("|---|---|---|---|")
    for maps in read_bake_folder(options.bake).garments:
        for name, tiles in sorted(maps.textures.items()):
            path = next(iter(tiles.values()))
            if path.suffix != ".exr" or "_id" in name or name in ("lay", "opacity_mask"):
                continue
            fine = read_mip_level(path).astype(np.float64)
            factor = len(fine) // options.side
            if factor < 2:
                continue
            ours = read_mip_level(path, factor.bit_length() - 1).astype(np.float64)
            side, count = options.side, fine.shape[2]
            box = fine.reshape(side, factor, side, factor, count).mean(axis=(1, 3))
            if name in DIRECTIONS:
                cosine = (unit(box) * unit(ours)).sum(axis=-1)
                cosine = cosine if DIRECTIONS[name] else np.abs(cosine)
                there = np.linalg.norm(ours, axis=-1) > 0.5
                off = np.degrees(np.arccos(np.clip(cosine[there], -1.0, 1.0)))
                unit_of = " degrees"
            else:
                off, unit_of = np.abs(box - ours), ""
            print(
                f"| {name} | {len(fine)} | {off.mean():.4f}{unit_of} | {off.max():.4f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()

"""Figures of the tubes for every preset, shipped as data: what models are fitted to and judged by.

python -m fabricusd.geometry.tables [--only NAME ...] remakes them.

A table is `data/NAME.npz`, read by `table`. Light comes from three sorts of directions in turn:
any within 80 degrees of the normal; near the mirror direction; grazing, 3 to 15 degrees above the
cloth. A third of each is held out: models are to be fitted to the others and judged by those.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.files import whole_file
from fabricusd.geometry.cloth import Cloth, tubes
from fabricusd.geometry.paths import Assumptions, Shares, albedo, reflectance
from fabricusd.schema import load, published_names

Floats = NDArray[np.float64]

PAIRS = 144
COUNT = 1 << 15
"""Paths a pair of directions; of the three that measure the uncertainty, FEWER."""
FEWER = 1 << 13
SKY_COUNT = 1 << 16
SEED = 20130401

POLAR = (0.0, 30.0, 45.0, 60.0, 75.0, 80.0, 85.0)
AZIMUTHS = (0.0, 45.0, 90.0)
SHADES = (1.0, 0.5, 0.2)
"""Albedos of the `conserving` threads whose shares are in a table, one a channel."""

FLATTER = 0.7
"""Height of the sections, over what just fits, for the figures' dependence on it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """One preset's figures. Views `v` are those of POLAR, each at all AZIMUTHS.

    wi, wo : (n, 3) - directions to the light and to the viewer, in the surface frame
    held_out : (n,) bool - whether the pair is for judging, and not for fitting
    value, error : (n, 3) - radiance per unit `L_i dwi` of the preset as it is, and standard error
    exit, height, width : () - how far `value` moves, mean absolute change over mean, when surface
        light leaves anywhere; when sections are FLATTER as high; when light goes by the width shown
    sky, sky_error : (v, 3) - reflected of a white sky, of the preset as it is
    once_up, once_down, up, down, shares_error : (v, 3) - of `conserving` threads of the albedos
        SHADES: reflected and transmitted after one scattering, and after all; error of up + down
    gap : (v,) - what passes between the threads
    lost : (v, 3) - what ends where tubes overlap, or on the backing of pile
    flatness : (2,) - height over width of the sections, weft and warp
    reach : () - share of the widths over which crossing threads are apart
    """

    wi: Floats
    wo: Floats
    held_out: NDArray[np.bool_]
    value: Floats
    error: Floats
    exit: Floats
    height: Floats
    width: Floats
    sky: Floats
    sky_error: Floats
    once_up: Floats
    once_down: Floats
    up: Floats
    down: Floats
    shares_error: Floats
    gap: Floats
    lost: Floats
    flatness: Floats
    reach: Floats


def table_names() -> list[str]:
    """Names of the presets that have a table, in order."""
    folder = resources.files("fabricusd.geometry") / "data"
    return sorted(f.name.removesuffix(".npz") for f in folder.iterdir() if f.name.endswith(".npz"))


@lru_cache(maxsize=32)
def table(name: str) -> Table:
    """The shipped table of a preset. Raises FabricError where there is none."""
    path = resources.files("fabricusd.geometry") / "data" / f"{name}.npz"
    if not path.is_file():
        raise FabricError(
            "geometry", f"has no table of '{name}'; there are {', '.join(table_names())}"
        )
    with path.open("rb") as file, np.load(file) as data:
        return Table(**{f.name: np.asarray(data[f.name]) for f in fields(Table)})


def directions() -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """(wi, wo, held_out) of every table: (PAIRS, 3), (PAIRS, 3), (PAIRS,)."""
    rng = np.random.default_rng(SEED)
    wi, wo = _spread(rng, PAIRS), _spread(rng, PAIRS)
    sort = np.arange(PAIRS) % 3
    near = wo * (-1, -1, 1) + 0.15 * rng.normal(size=(PAIRS, 3))
    near[:, 2] = np.abs(near[:, 2]) + 0.05
    near /= np.linalg.norm(near, axis=1)[:, None]
    low = np.radians(rng.uniform(3.0, 15.0, PAIRS))
    turn = rng.uniform(0.0, 2 * math.pi, PAIRS)
    grazing = np.stack(
        (np.cos(low) * np.cos(turn), np.cos(low) * np.sin(turn), np.sin(low)), axis=1
    )
    wi = np.where((sort == 1)[:, None], near, np.where((sort == 2)[:, None], grazing, wi))
    return wi, wo, np.arange(PAIRS) // 3 % 3 == 0


def _spread(rng: np.random.Generator, count: int) -> Floats:
    """(count, 3) by the cosine, within 80 degrees of the normal."""
    z = np.sqrt(rng.uniform(math.cos(math.radians(80.0)) ** 2, 1.0, count))
    turn, r = rng.uniform(0.0, 2 * math.pi, count), np.sqrt(1 - z * z)
    return np.stack((r * np.cos(turn), r * np.sin(turn), z), axis=1)


def views() -> Floats:
    """(v, 3) directions of POLAR and AZIMUTHS."""
    polar, turn = np.meshgrid(np.radians(POLAR), np.radians(AZIMUTHS), indexing="ij")
    found = np.stack(
        (np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)), axis=-1
    )
    return np.asarray(found.reshape(-1, 3))


def conserving(fabric: Fabric, shades: Sequence[float] = SHADES) -> Fabric:
    """`fabric` with `conserving` threads of the albedos `shades`, one a channel."""
    r, g, b = shades
    threads = {k: replace(t, albedo=(r, g, b), model="") for k, t in fabric.threads.items()}
    return replace(fabric, threads=threads, model="conserving", back=None)


def make(name: str) -> Table:
    """Trace a preset's table anew. Raises FabricError for a preset without a geometry."""
    fabric = load(name)
    cloth = tubes(fabric)
    wi, wo, held_out = directions()
    whole = reflectance(cloth, wo, wi, count=COUNT, seed=SEED)
    usual = reflectance(cloth, wo, wi, count=FEWER, seed=SEED).value
    scale = float(usual.mean())

    def moved(other: Cloth, assumptions: Assumptions) -> Floats:
        found = reflectance(other, wo, wi, count=FEWER, seed=SEED, assumptions=assumptions).value
        return np.asarray(np.abs(found - usual).mean() / scale)

    sky = albedo(cloth, views(), count=SKY_COUNT, seed=SEED)
    shares = shares_of(cloth)
    return Table(
        wi=wi,
        wo=wo,
        held_out=held_out,
        value=whole.value,
        error=whole.error,
        exit=moved(cloth, Assumptions(correlated=False)),
        height=moved(tubes(fabric, squash=FLATTER), Assumptions()),
        width=moved(cloth, Assumptions(by_width=not cloth.conserving)),
        sky=sky.reflected,
        sky_error=sky.error,
        once_up=shares.reflected_once,
        once_down=shares.transmitted_once,
        up=shares.reflected,
        down=shares.transmitted,
        shares_error=shares.error,
        gap=shares.gap,
        lost=shares.lost,
        flatness=cloth.flatness,
        reach=np.asarray(cloth.repeat.reach),
    )


def shares_of(cloth: Cloth) -> Shares:
    """The shares of the same tubes with `conserving` threads."""
    return albedo(cloth.with_fabric(conserving(cloth.fabric)), views(), count=SKY_COUNT, seed=SEED)


def save(found: Table, path: Path) -> None:
    """Write a table; in single precision, which its errors allow."""
    columns: dict[str, Any] = {}
    for f in fields(Table):
        column = np.asarray(getattr(found, f.name))
        columns[f.name] = column if column.dtype == bool else column.astype(np.float32)
    with whole_file(path) as target, Path(target).open("wb") as file:
        np.savez_compressed(file, **columns)


def main(arguments: Sequence[str] | None = None) -> int:
    """Remake the tables of the presets named, or of all that have a geometry."""
    parser = argparse.ArgumentParser(
        prog="python -m fabricusd.geometry.tables", description=__doc__
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", default=published_names())
    folder = Path(__file__).resolve().parent / "data"
    parser.add_argument("-o", "--output", type=Path, default=folder, metavar="FOLDER")
    options = parser.parse_args(arguments)
    for name in options.only:
        begun = time.perf_counter()
        try:
            found = make(name)
        except FabricError as error:
            print(f"{name}: no table: {error}")
            continue
        save(found, options.output / f"{name}.npz")
        print(f"{name}: {time.perf_counter() - begun:.0f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

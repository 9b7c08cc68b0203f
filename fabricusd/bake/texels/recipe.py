"""Compile a fabric into the tables from which the kernels of `moments` compute its texels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.scattering.models import translucent
from fabricusd.appearance.shadow.kinds import Shadow
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.lookup import back_of
from fabricusd.appearance.weave.yarn.compiled import Yarn, compile_yarn
from fabricusd.bake.texels.angle_rows import STEPS, angle_rows, back_rows, height_rows
from fabricusd.bake.texels.light import unit_light
from fabricusd.bake.texels.moment_indices import MOMENTS
from fabricusd.bake.texels.moments import texels
from fabricusd.bake.texels.repeat import baked_repeat
from fabricusd.fabric import Fabric


class Recipe(NamedTuple):
    """The tables of a fabric.

    cloth, shadow : compiled for float32; `shadow` is evaluated for the direction `light`
    yarn : of the threads; uneven : int - 1 if they vary, and the yarn is to be read
    table, kinds : horizon table of `compile_shadow(..., "horizon")`
    rows, heights : see `angle_rows`
    rounded : int - 1 if threads are round across their width
    light : (3,) float32 - unit vector to the light in the weave's frame; zero for none
    two_sided : int - 1 if the moments of the back are computed
    back, back_rows : the cloth seen from behind at (u, -v), and what it adds, see `back_rows`
    mean : (MOMENTS,) float32 - moments of the whole repeat
    """

    cloth: CompiledFabric
    yarn: Yarn
    uneven: int
    shadow: Shadow
    table: NDArray[np.uint8]
    kinds: NDArray[np.int32]
    rows: NDArray[np.float32]
    heights: NDArray[np.float32]
    rounded: int
    light: NDArray[np.float32]
    two_sided: int
    back: CompiledFabric
    back_rows: NDArray[np.float32]
    mean: NDArray[np.float32]


def recipe(
    fabric: Fabric,
    *,
    level: str = "weave",
    light: tuple[float, float, float] | None = None,
    method: str = "peak",
    back: bool = True,
) -> Recipe:
    """Compile the tables of `fabric`.

    level : "weave" for threads that are flat across their width, "thread" for round ones
    light : direction to the light in the surface frame, for the shadow mask
    method : method of the shadow mask
    back : whether the back is baked, where threads scatter light to the other side
    """
    two_sided = back and translucent(fabric)
    behind = back_of(fabric) if two_sided else fabric
    cloth = compile_fabric(fabric, precision=np.float32)
    horizon = compile_shadow(fabric, "horizon")
    shadow = compile_shadow(fabric, method) if light is not None else horizon
    towards = np.array((0.0, 0.0, 0.0) if light is None else unit_light(light))
    made = Recipe(
        cloth=cloth,
        yarn=compile_yarn(fabric),
        uneven=0,
        shadow=shadow,
        table=horizon.table,
        kinds=horizon.kinds,
        rows=angle_rows(fabric),
        heights=height_rows(fabric),
        rounded=int(level == "thread"),
        light=towards.astype(np.float32),
        two_sided=int(two_sided),
        back=compile_fabric(behind, precision=np.float32) if two_sided else cloth,
        back_rows=back_rows(behind) if two_sided else np.zeros((2, 1, STEPS, 4), np.float32),
        mean=np.zeros(MOMENTS, np.float32),
    )
    # The mean over the repeat is that of even threads, which uneven ones keep.
    return made._replace(mean=repeat_mean(fabric, made), uneven=int(fabric.is_uneven))


def repeat_mean(fabric: Fabric, made: Recipe) -> NDArray[np.float32]:
    """(MOMENTS,) means over one repeat, from about 16 samples per thread along each axis."""
    repeat = baked_repeat(fabric)
    count = [min(max(16 * n, 256), 2048) for n in repeat]
    moments = np.empty((MOMENTS, count[1], 1), np.float32)
    sums = np.empty(MOMENTS, np.float32)
    nobody = np.zeros((count[1], 1), np.int32)
    total = np.zeros(MOMENTS)
    across = np.array([[repeat[0] / count[0], 0.0], [0.0, repeat[1] / count[1]]])
    for column in range(count[0]):
        start = np.array([across[0, 0] * column, 0.0])
        texels(made, across, across, start, (column, 0), nobody, 0, 1, sums, moments)
        total += moments[:, :, 0].mean(axis=1, dtype=np.float64)
    return (total / count[0]).astype(np.float32)

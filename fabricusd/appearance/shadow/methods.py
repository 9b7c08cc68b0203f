"""Thread-to-thread shadowing: four methods to decide whether light reaches a point of the weave.

Each method computes `g(x, wi)` in [0, 1], `docs/model.md` section 5, from the same height field.
`g` is 1 on pile, which has no height field, and 0 for light at or below the cloth:

none    : 1; the effect of neighbouring threads is left to the masking term
peak    : the nearest of the highest points is the horizon in every direction, [Bisker2011] 5.2.3
horizon : a table of the horizon by place on the thread and azimuth, [Max1988]; for large repeats
          by neighbourhood, see `neighbourhoods`
traced  : the height field is marched along the ray; the reference for the other methods

The value of the cloth is multiplied by `shade`. Under a surface law that is `absolute` it is `g`,
and level `far` holds its mean. Under the others it is `g` over its mean over the places that
scatter alike: the law already contains the mean shadow, and `g` only says where it falls. Either
way level `far` is the mean of the others. Threads are round across their width at every level. See
docs/decisions/004 and 017.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from fabricusd.appearance.frame import WARP
from fabricusd.appearance.laws import law_of
from fabricusd.appearance.scattering.model import PUBLISHED
from fabricusd.appearance.scattering.models import model_of
from fabricusd.appearance.shadow.crests import to_crest
from fabricusd.appearance.shadow.height import (
    Origin,
    highest_point,
    steepest,
)
from fabricusd.appearance.shadow.horizon import (
    AZIMUTHS,
    NO_KINDS,
    SOFTNESS,
    TEXELS,
    diamond_directions,
    horizon_table,
    shape_repeat,
)
from fabricusd.appearance.shadow.horizon_blocks import choose_texels, mix_texels
from fabricusd.appearance.shadow.horizon_lookup import (
    above_horizon,
    horizon_at,
    soft_edge,
)
from fabricusd.appearance.shadow.kinds import (
    HORIZON,
    METHODS,
    NONE,
    PEAK,
    TRACED,
    Shadow,
)
from fabricusd.appearance.shadow.mean import (
    ELEVATION,
    GROUPS,
    SECTORS,
    bounds_of,
    groups_of,
    level_of,
    mean_of,
    mean_over,
    places_on,
    relative,
    stretch_of,
    stretches,
    types_of,
)
from fabricusd.appearance.shadow.place_blocks import (
    FIRST,
    FREE,
    INT_ROWS,
    LIT,
    MEAN,
    OF_SET,
    PAST,
    PIECE,
    REAL_ROWS,
    SECOND,
    SHARES,
    TURN,
    X,
    look_up_block,
)
from fabricusd.appearance.shadow.towards import horizons_towards
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.appearance.weave.curve import crest, peak
from fabricusd.appearance.weave.lookup import (
    crown_on,
    find,
    height_on,
)
from fabricusd.appearance.weave.place import Hit
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import BLOCK, INLINE, KERNEL, PART, index, whole

TRACED_SOFTNESS = math.radians(1.0)
"""Width [rad] of the soft edge used for the mean of `traced`; the marched `g` has a hard edge."""

COLUMNS = 128
_COLUMNS = (1, 4, COLUMNS, 64)
"""Azimuths for the mean of each method: for `horizon` eight to each of the table's, so that places
keep their order from one to the next."""

PEAK_SOFTNESS = math.radians(5.0)
"""Width [rad] of the edge of a `peak` shadow. The horizon of `peak` is a guess, and a sharper edge
would only alias."""

MEAN_PLACES, FEWER_PLACES = 4096, 64
"""Places of each stretch over which the mean of `g` is taken; fewer where each takes a march."""


def compile_shadow(
    fabric: Fabric,
    method: str = "horizon",
    *,
    softness: float | None = None,
    azimuths: int = AZIMUTHS,
    texels: int = TEXELS,
    precision: type[np.floating[Any]] = np.float32,
) -> Shadow:
    """The tables of shadowing `method`, one of METHODS, for `fabric`.

    softness : angular width of the light [rad], over which a shadow's edge is spread; None takes
        `horizon.SOFTNESS` for `horizon` and PEAK_SOFTNESS for `peak`
    azimuths, texels : size of the horizon table: directions, and texels along a thread in one cell

    The horizon table of a large repeat, such as a figured cloth of hundreds of ends and picks, has
    an entry for each neighbourhood: see `horizon.Horizon`.
    """
    if method not in METHODS:
        raise FabricError("shadow", f"is '{method}'; it must be one of {', '.join(METHODS)}")
    if softness is not None and not softness > 0:
        raise FabricError("softness", f"is {softness}; it must be above 0")
    cloth = compile_fabric(fabric, precision=np.float64)
    highest = highest_point(fabric, cloth)
    table, kinds = np.zeros((1, 1, 1, 1, 1), np.uint8), NO_KINDS
    if method == "horizon":
        table, kinds = horizon_table(fabric, cloth, highest, azimuths, texels)
    found = [crest(t.curve) for t in fabric.thread_list]
    first = np.ones((len(found), max(len(c) for c in found)))
    last = np.zeros_like(first)
    for row, crests in enumerate(found):
        first[row, : len(crests)], last[row, : len(crests)] = crests.T
    cut = stretches(fabric, cloth.curve_start.shape[1])
    double = Shadow(
        method=METHODS.index(method),
        highest=np.float64(highest),
        softness=np.float64(_softness(method, softness)),
        crest_first=first,
        crest_last=last,
        crest_height=np.array([peak(t.curve) for t in fabric.thread_list]),
        table=table,
        kinds=kinds,
        texels=_with_next_row(table),
        mean=np.ones(1),
        mean_bounds=np.zeros(1, np.int32),
        mean_columns=_COLUMNS[METHODS.index(method)],
        groups=GROUPS,
        set_stretches=cut.set_stretches,
        piece_first=cut.piece_first,
        piece_last=cut.piece_last,
        piece_scale=cut.piece_scale,
        absolute=_absolute(fabric),
        all_absolute=int(_absolute(fabric).all()),
    )
    if double.method != NONE:
        mean = _mean(fabric, cloth, double, 2 * cut.set_stretches)
        double = double._replace(mean=mean.reshape(-1))
        if double.method == HORIZON:
            bounds = bounds_of(mean, float(double.softness))
            # Threads whose law takes g itself need no mean.
            bounds[double.absolute[types_of(cut)] != 0] = 0
            double = double._replace(mean_bounds=bounds.reshape(-1))
    return Shadow(*(_in_precision(value, precision) for value in double))


def _with_next_row(table: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """`Shadow.texels`."""
    flat = table.reshape(-1).astype(np.uint16)
    flat[: -table.shape[-1]] += flat[table.shape[-1] :] << 8
    return flat


def _softness(method: str, asked: float | None) -> float:
    if asked is not None:
        return asked
    return {"traced": TRACED_SOFTNESS, "horizon": SOFTNESS}.get(method, PEAK_SOFTNESS)


def _absolute(fabric: Fabric) -> NDArray[np.uint8]:
    """`Shadow.absolute`: of `conserving` threads never, since their law masks."""
    law = law_of(fabric)
    laws = [model_of(fabric, t).law for t in fabric.thread_list]
    return np.array([law.absolute and one == PUBLISHED for one in laws], np.uint8)


def _in_precision(value: Any, precision: type[np.floating[Any]]) -> Any:
    """A field of `Shadow` whose reals are of `precision`."""
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        return np.ascontiguousarray(value, dtype=precision)
    return precision(value) if isinstance(value, np.float64) else value


def _mean(fabric: Fabric, cloth: CompiledFabric, shadow: Shadow, count: int) -> NDArray[Any]:
    """`Shadow.mean`, not flat; shadow : the other fields, in float64."""
    traced = shadow.method == TRACED
    columns = shadow.mean_columns
    each = FEWER_PLACES if traced else MEAN_PLACES
    uv, number = places_on(cloth, shape_repeat(fabric), shadow, count, each)
    sine = horizons_towards(cloth, shadow, uv, diamond_directions(columns))
    return groups_of(number, count, np.arcsin(sine) / float(shadow.softness))


@njit(**INLINE)
def mean_lit(R, cloth, shadow, hit, x, y, z):
    """Mean of `g` over the stretch that a `Hit` is on, for light from (x, y, z) above the cloth."""
    stretch = stretch_of(R, cloth, shadow, hit.thread_set, hit.thread, hit.s)
    return mean_of(R, shadow, stretch, x, y, z)


@njit(**INLINE)
def shade(R, cloth, shadow, u, v, hit, x, y, z):
    """The factor of the value at a point for light from (x, y, z); see the module's docstring.

    The arguments are those of `lit`.
    """
    g = lit(R, cloth, shadow, u, v, hit, x, y, z)
    free = hit.thread_set == GAP or cloth.pile[hit.thread] != 0
    if shadow.method == NONE or free or shadow.absolute[hit.thread] != 0 or not g >= R(0):
        return g
    if z <= R(0):
        return g
    return relative(R, g, mean_lit(R, cloth, shadow, hit, x, y, z))


@njit(**INLINE)
def lit(R, cloth, shadow, u, v, hit, x, y, z):
    """`g`: the share of light from direction (x, y, z) of the surface frame that reaches a point.

    u, v : weave coordinates, float64; hit : the `Hit` at (u, v)

    NaN in the arguments gives NaN, and never indexes a table.
    """
    flat = math.sqrt(x * x + y * y)
    which, thread = hit.thread_set, hit.thread
    if not (hit.s >= R(0) and flat < R(2) and z < R(2)):
        return R(np.nan)
    if z <= R(0):
        return R(0)
    if shadow.method == NONE or which == GAP or cloth.pile[thread] != 0:
        return R(1)
    if flat <= R(1e-6) * z:
        return R(1)
    if shadow.method == HORIZON:
        sine = horizon_at(R, cloth, shadow.table, shadow.kinds, u, v, which, x, y)
        return soft_edge(R, above_horizon(R, sine, flat, z), shadow.softness)
    axis = height_on(R, cloth, which, thread, hit.s, hit.length)
    if shadow.method == PEAK:
        # [Bisker2011] gives a place on the thread one height at every level, so threads are flat.
        drop = shadow.highest - axis - cloth.half_height[which, thread]
        if drop <= R(1e-6) * shadow.highest:
            return R(1)
        # A horizon lower than this one cannot reach the soft edge of the shadow.
        lowest = max(z / flat - shadow.softness * (R(1) + z * z / (flat * flat)), R(1e-6))
        distance = R(to_crest(cloth, shadow, u, v, float(drop / lowest)))
        reach = math.sqrt(drop * drop + distance * distance)
        return soft_edge(R, (z * distance - flat * drop) / reach, shadow.softness)
    crown = crown_on(R, cloth, which, thread, hit.w)
    origin = Origin(u, v, which, float(crown), float(axis + crown))
    slope = float(z) / float(flat)
    found = steepest(
        cloth, float(shadow.highest), origin,
        float(x) / float(flat), float(y) / float(flat), slope, True,
    )  # fmt: skip
    return R(0) if found > slope else R(1)


@njit(**PART)
def horizon_block(R, cloth, shadow, wi, begin, size, ints, reals):
    """Compute `lit` from the horizon table at the places found by `look_up_block`, into the row
    LIT.

    wi : (3, n), of which the block uses the columns from `begin` on
    """
    table = shadow.table
    choose_texels(R, cloth, table, wi, begin, size, ints, reals)
    mix_texels(R, shadow.texels, size, ints, reals)
    for k in range(size):
        m = index(begin, k)
        x, y, z = wi[0, m], wi[1, m], wi[2, m]
        flat = math.sqrt(x * x + y * y)
        g = soft_edge(R, above_horizon(R, reals[LIT + k], flat, z), shadow.softness)
        g = R(1) if ints[FREE + k] != 0 else g
        g = g if z > R(0) else R(0)
        sound = reals[X + k] >= R(0) and flat < R(2) and z < R(2)
        reals[LIT + k] = g if sound else R(np.nan)


@njit(**PART)
def mean_block(R, cloth, shadow, wi, begin, size, ints, reals):
    """Turn the row LIT from `lit` to `shade`, in loops like those of `horizon_blocks`.

    Most light reaches all or no places of a stretch, whose mean is then 1 or 0: the sum over groups
    is for the others alone. The rows FIRST, SECOND and SHARES, which `horizon_block` no longer
    needs, hold what goes between the loops.
    """
    if shadow.all_absolute != 0:
        return
    columns, softness = np.int32(shadow.mean_columns), shadow.softness
    to_columns = R(columns) / R(shadow.table.shape[4])
    scales, firsts = shadow.piece_scale.reshape(-1), shadow.piece_first.reshape(-1)
    of_set = np.int32(shadow.set_stretches)
    for k in range(size):
        # In gaps and for NaN the stretch is arbitrary: the result is not used.
        piece, past = np.uintp(ints[PIECE + k]), reals[PAST + k]
        past = past if past >= R(0) else R(0)
        of_warp = of_set if ints[OF_SET + k] == WARP else np.int32(0)
        ints[FIRST + k] = of_warp + firsts[piece] + np.int32(past * scales[piece])
    for k in range(size):
        turn = reals[TURN + k] * to_columns
        column = min(np.int32(turn), columns - np.int32(1))
        stretch = ints[FIRST + k]
        ints[FIRST + k] = (stretch * (columns + 1) + column) * GROUPS
        ints[SECOND + k] = stretch * SECTORS + column // np.int32(COLUMNS // SECTORS)
        reals[SHARES + k] = turn - R(column)
        reals[SHARES + BLOCK + k] = level_of(R, wi[2, index(begin, k)], softness)
    for k in range(size):
        ints[SECOND + k] = shadow.mean_bounds[np.uintp(ints[SECOND + k])]
    for k in range(size):
        bounds, level = ints[SECOND + k], reals[SHARES + BLOCK + k]
        elevation = np.int32((level - R(0.5)) * (softness * R(ELEVATION)))
        bound = (wi[2, index(begin, k)] > R(0)) & (ints[FREE + k] == 0)
        dark = bound & (elevation < (bounds & 0xFFFF))
        ints[SECOND + k] = bound & (elevation >= (bounds & 0xFFFF)) & (elevation < (bounds >> 16))
        reals[MEAN + k] = R(0) if dark else R(1)
    count = np.int32(0)
    for k in range(size):
        needed = ints[SECOND + k]
        ints[SECOND + whole(count)] = k
        count += needed
    _sum_groups(R, shadow.mean, count, ints, reals)
    for k in range(size):
        reals[LIT + k] = relative(R, reals[LIT + k], reals[MEAN + k])


@njit(**PART)
def _sum_groups(R, mean, count, ints, reals):
    """The row MEAN at the first `count` places of the row SECOND."""
    for n in range(whole(count)):
        x = whole(ints[SECOND + n])
        first = np.uintp(whole(ints[FIRST + x]))
        c, level = reals[SHARES + x], reals[SHARES + BLOCK + x]
        reals[MEAN + x] = mean_over(R, mean, GROUPS, first, first + np.uintp(GROUPS), c, level)


@njit(**PART)
def _one_by_one(R, cloth, shadow, shaded, uv, begin, wi, out):
    """`shade` if `shaded`, else `lit`, at `out.size` places from `begin` on."""
    for k in range(out.size):
        u, v = uv[begin + k, 0], uv[begin + k, 1]
        x, y, z = wi[0, begin + k], wi[1, begin + k], wi[2, begin + k]
        which, thread, s, w, _, length = find(R, cloth, u, v)
        hit = Hit(which, thread, s, w, length)
        if shaded:
            out[k] = shade(R, cloth, shadow, u, v, hit, x, y, z)
        else:
            out[k] = lit(R, cloth, shadow, u, v, hit, x, y, z)


@njit(parallel=True, **KERNEL)
def lit_all(R, cloth, shadow, shaded, uv, wi, out):
    """`shade` if `shaded`, else `lit`, at places uv (n, 2) float64 for light wi (3, n): out
    (n,)."""
    n = uv.shape[0]
    for b in prange((n + BLOCK - 1) // BLOCK):
        begin, size = b * BLOCK, min(BLOCK, n - b * BLOCK)
        found = out[begin : begin + size]
        if shadow.method != HORIZON:
            _one_by_one(R, cloth, shadow, shaded, uv, begin, wi, found)
        else:
            ints, reals = np.empty(INT_ROWS * BLOCK, np.int32), np.empty(REAL_ROWS * BLOCK, R)
            look_up_block(R, cloth, shadow, uv, begin, size, ints, reals)
            horizon_block(R, cloth, shadow, wi, begin, size, ints, reals)
            if shaded:
                mean_block(R, cloth, shadow, wi, begin, size, ints, reals)
            found[:] = reals[LIT : LIT + size]


def shadowing(
    fabric: Fabric,
    wi: ArrayLike,
    uv_threads: ArrayLike,
    method: str = "horizon",
    *,
    compiled: tuple[CompiledFabric, Shadow] | None = None,
) -> NDArray[Any]:
    """`g` (n,) for light from unit directions wi (n, 3) at weave coordinates uv_threads (n, 2).

    compiled : the compiled fabric and its `compile_shadow`, if the caller has them; `method` is
        then ignored. Otherwise both are compiled in float64.
    """
    if compiled is None:
        cloth = compile_fabric(fabric, precision=np.float64)
        shadow = compile_shadow(fabric, method, precision=np.float64)
    else:
        cloth, shadow = compiled
    real = cloth.curve_start.dtype.type
    uv = np.ascontiguousarray(uv_threads, np.float64)
    light = np.ascontiguousarray(wi, real)
    if uv.ndim != 2 or uv.shape[1] != 2 or light.shape != (len(uv), 3):
        raise FabricError(
            "wi, uv_threads", f"have shapes {light.shape}, {uv.shape}; they must be (n, 3), (n, 2)"
        )
    for name, values in (("wi", light), ("uv_threads", uv)):
        bad = ~np.isfinite(values).all(axis=1)
        if bad.any():
            raise FabricError(
                name,
                f"has {int(bad.sum())} of {len(uv)} rows that are not finite, the first at "
                f"{int(np.argmax(bad))}",
            )
    out = np.empty(len(uv), real)
    lit_all(real, cloth, shadow, False, uv, np.ascontiguousarray(light.T), out)
    return out

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
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.laws import law_of
from fabricusd.appearance.laws.lit import GROUPS
from fabricusd.appearance.scattering.model import PUBLISHED
from fabricusd.appearance.scattering.models import model_of
from fabricusd.appearance.shadow.height import (
    Origin,
    highest_point,
    steepest,
)
from fabricusd.appearance.shadow.horizon import (
    AZIMUTHS,
    LOWEST,
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
from fabricusd.appearance.shadow.mean import (
    groups_of,
    mean_of,
    places_on,
    relative,
    stretch_of,
    stretches,
)
from fabricusd.appearance.shadow.place_blocks import (
    FREE,
    INT_ROWS,
    LIT,
    OF_SET,
    OF_THREAD,
    REAL_ROWS,
    S,
    X,
    look_up_block,
)
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.appearance.weave.curve import crest, peak
from fabricusd.appearance.weave.lookup import (
    crown_on,
    find,
    height_on,
    lower_run,
    upper_run,
    wrap,
)
from fabricusd.appearance.weave.place import Hit
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import BLOCK, INLINE, KERNEL, PART, index

METHODS = ("none", "peak", "horizon", "traced")
NONE, PEAK, HORIZON, TRACED = range(4)

TRACED_SOFTNESS = math.radians(1.0)
"""Width [rad] of the soft edge used for the mean of `traced`; the marched `g` has a hard edge."""

_COLUMNS = (1, 4, 128, 64)
"""Azimuths for the mean of each method: for `horizon` eight to each of the table's, so that places
keep their order from one to the next."""

PEAK_SOFTNESS = math.radians(5.0)
"""Width [rad] of the edge of a `peak` shadow. The horizon of `peak` is a guess, and a sharper edge
would only alias."""

MEAN_PLACES, FEWER_PLACES = 512, 64
"""Places of each stretch over which the mean of `g` is taken; fewer where each takes a march."""

SEARCH = 64
"""Radius [cells] in which `peak` searches for the highest point. Beyond it, the horizon of every
published fabric is below a quarter of a degree."""


class Shadow(NamedTuple):
    """The tables that a shadowing method needs in addition to the compiled fabric.

    method : int - NONE, PEAK, HORIZON or TRACED
    highest : real - greatest height of the field [m]
    softness : real - width of the shadow's edge in the light's elevation [rad]; of its mean only
        for `traced`
    crest_first, crest_last : (k, q) real - intervals of each type's run that are as high as its
        peak; an interval is empty if its last position is less than its first
    crest_height : (k,) real - height there, in run lengths
    table, kinds : of `horizon.Horizon`; a single zero and (0, 0) for the other methods
    texels : the same memory as a one-dimensional array
    mean : (stretches, columns + 1, GROUPS) real, flat - `mean.groups_of`, horizons in softnesses;
        one entry for `none`
    mean_columns, groups : int - its azimuths; GROUPS
    mean_first, piece_first, piece_last, piece_scale : see `mean.Stretches`
    absolute : (k,) uint8 - whether threads of the type follow a law with an absolute shadow
    all_absolute : int - whether all do
    """

    method: int
    highest: Any
    softness: Any
    crest_first: NDArray[Any]
    crest_last: NDArray[Any]
    crest_height: NDArray[Any]
    table: NDArray[np.uint8]
    kinds: NDArray[np.int32]
    texels: NDArray[np.uint8]
    mean: NDArray[Any]
    mean_columns: int
    groups: int
    mean_first: NDArray[np.int32]
    piece_first: NDArray[np.int32]
    piece_last: NDArray[np.int32]
    piece_scale: NDArray[Any]
    absolute: NDArray[np.uint8]
    all_absolute: int


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
        texels=table.reshape(-1),
        mean=np.ones(1),
        mean_columns=_COLUMNS[METHODS.index(method)],
        groups=GROUPS,
        mean_first=cut.first,
        piece_first=cut.piece_first,
        piece_last=cut.piece_last,
        piece_scale=cut.piece_scale,
        absolute=_absolute(fabric),
        all_absolute=int(_absolute(fabric).all()),
    )
    if double.method != NONE:
        double = double._replace(mean=_mean(fabric, cloth, double, cut.total))
    return Shadow(*(_in_precision(value, precision) for value in double))


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
    """`Shadow.mean`; shadow : the other fields, in float64."""
    traced = shadow.method == TRACED
    columns = shadow.mean_columns
    each = FEWER_PLACES if traced else MEAN_PLACES
    uv, number = places_on(cloth, shape_repeat(fabric), shadow, count, each)
    sine = np.zeros((len(uv), columns))
    real: Any = np.float64
    _horizons(real, cloth, shadow, uv, diamond_directions(columns), sine)
    return groups_of(number, count, np.arcsin(sine) / float(shadow.softness)).reshape(-1)


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
        distance = R(_to_crest(cloth, shadow, u, v, float(drop / lowest)))
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
def _to_crest(cloth, shadow, u, v, most):
    """Distance on the cloth [m] to the nearest of the highest points, or `most` if it is
    farther."""
    end, pick = np.floor(u), np.floor(v)
    pitch_u, pitch_v = float(cloth.pitch[WARP]), float(cloth.pitch[WEFT])
    best = most
    for ring in range(SEARCH):
        if (ring - 1) * min(pitch_u, pitch_v) > best:
            break
        for di in range(-ring, ring + 1):
            step = 1 if abs(di) == ring else max(1, 2 * ring)
            for dj in range(-ring, ring + 1, step):
                best = _crest_in_cell(cloth, shadow, u, v, end + di, pick + dj, best)
    return best


@njit(**PART)
def _crest_in_cell(cloth, shadow, u, v, end, pick, best):
    """The smaller of `best` and the distance [m] to the highest points of one cell."""
    i, j = wrap(end, cloth.grid.shape[0]), wrap(pick, cloth.grid.shape[1])
    top = int(cloth.grid[i, j])
    edge = 0.5 - 0.5 * float(cloth.width[top])
    for part in range(3 if cloth.runs.shape[2] > 1 else 1):
        # The thread on top, then the thread underneath before and behind it.
        which = top if part == 0 else 1 - top
        if which == WARP:
            thread = int(cloth.sequence[WARP, wrap(end, cloth.sequence_length[WARP])])
        else:
            thread = int(cloth.sequence[WEFT, wrap(pick, cloth.sequence_length[WEFT])])
        low, high = 0.0, 1.0
        if part == 0:
            start, cells = upper_run(np.float64, cloth, i, j, top)
            rises = 1.0
        else:
            start, cells, rises = lower_run(np.float64, cloth, i, j, top, part - 1.0)
            low, high = (0.0, edge) if part == 1 else (1.0 - edge, 1.0)
        visible = float(cloth.width[which]) if high > low else 0.0
        run = rises * cells * float(cloth.pitch[1 - which])
        half = float(cloth.half_height[which, thread])
        height = run * float(shadow.crest_height[thread]) + half + float(cloth.lift[which])
        if visible <= 0.0 or cloth.pile[thread] != 0 or height < 0.999999 * shadow.highest:
            continue
        across = 0.5 * visible
        for q in range(shadow.crest_first.shape[1]):
            a = max(low, float(shadow.crest_first[thread, q]) * cells - start)
            b = min(high, float(shadow.crest_last[thread, q]) * cells - start)
            if a > b:
                continue
            if which == WARP:
                du = max(0.0, abs(u - end - 0.5) - across)
                dv = max(0.0, a - (v - pick), (v - pick) - b)
            else:
                du = max(0.0, a - (u - end), (u - end) - b)
                dv = max(0.0, abs(v - pick - 0.5) - across)
            best = min(
                best,
                math.hypot(du * float(cloth.pitch[WARP]), dv * float(cloth.pitch[WEFT])),
            )
    return best


@njit(**PART)
def horizon_block(R, cloth, shadow, wi, begin, size, ints, reals):
    """Compute `lit` from the horizon table at the places found by `look_up_block`, into the row
    LIT.

    wi : (3, n), of which the block uses the columns from `begin` on
    """
    table = shadow.table
    choose_texels(R, cloth, table, wi, begin, size, ints, reals)
    mix_texels(R, shadow.texels, table.shape[4], size, ints, reals)
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
    """Turn the row LIT from `lit` to `shade`, in loops like those of `horizon_blocks`."""
    if shadow.all_absolute != 0:
        return
    for k in range(size):
        m = index(begin, k)
        g, z = reals[LIT + k], wi[2, m]
        thread = np.uintp(ints[OF_THREAD + k])
        # Where LIT is NaN it stays NaN, and the NaN must not index the table.
        if not g >= R(0) or z <= R(0) or ints[FREE + k] != 0 or shadow.absolute[thread] != 0:
            continue
        which = np.uintp(ints[OF_SET + k])
        stretch = stretch_of(R, cloth, shadow, which, thread, reals[S + k])
        reals[LIT + k] = relative(R, g, mean_of(R, shadow, stretch, wi[0, m], wi[1, m], z))


@njit(**KERNEL, parallel=True)
def _horizons(R, cloth, shadow, uv, directions, out):
    """Sine of the horizon's elevation at uv (n, 2) in each of `directions` (c, 2): out (n, c)."""
    for k in prange(uv.shape[0]):
        _horizons_at(R, cloth, shadow, uv[k, 0], uv[k, 1], directions, out[k])


@njit(**KERNEL)
def _horizons_at(R, cloth, shadow, u, v, directions, out):
    which, thread, s, w, _, length = find(R, cloth, u, v)
    if which == GAP or cloth.pile[thread] != 0:
        return
    crown = crown_on(R, cloth, which, thread, w)
    axis = height_on(R, cloth, which, thread, s, length)
    if shadow.method == PEAK:
        drop = shadow.highest - axis - cloth.half_height[which, thread]
        if drop > R(1e-6) * shadow.highest:
            distance = _to_crest(cloth, shadow, u, v, drop / R(1e-3))
            out[:] = drop / math.sqrt(drop * drop + distance * distance)
        return
    origin = Origin(u, v, which, crown, axis + crown)
    for c in range(directions.shape[0]):
        x, y = directions[c, 0], directions[c, 1]
        if shadow.method == HORIZON:
            out[c] = horizon_at(R, cloth, shadow.table, shadow.kinds, u, v, which, x, y)
        else:
            slope = steepest(cloth, shadow.highest, origin, x, y, LOWEST, False)
            out[c] = slope / math.sqrt(R(1) + slope * slope) if slope > LOWEST else R(0)


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

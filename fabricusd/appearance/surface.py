"""Evaluate and sample cloth: the public functions, for every level and shadowing method.

Directions are unit vectors in the surface frame: x = U (along the weft), y = V (along the warp),
z = N on the viewer's side. `wo` points to the viewer and is given; `wi` points to the light. A
value is the radiance per unit `L_i dwi`, cosine included. The published models are 0 if either
direction is at or below the cloth.

    far     the mean over the repeat; it has no place and no shadowing
    weave   the thread under a point of the weave
    thread  the same, and the position across the thread

The fuzz of hairy threads lies over all of them.

Arrays are float64, and results are exact to rounding. The kernels behind these functions also take
float32 and are what the path tracer calls: `far`, `levels`, `mixture`. Source: `docs/model.md`
sections 4-6.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from fabricusd.appearance.accuracy import choose_rule
from fabricusd.appearance.conserving.blocks import (
    conserving_far_values,
    conserving_point_values,
)
from fabricusd.appearance.fuzz import Fuzz, bald, compile_fuzz, fuzz_over_all, optical_depth
from fabricusd.appearance.law import (
    CONSERVING_ONLY,
    PUBLISHED_ONLY,
    SurfaceLaw,
    law_density,
    law_direction,
    surface_law,
)
from fabricusd.appearance.laws import law_of
from fabricusd.appearance.layer import layer_of
from fabricusd.appearance.levels import FAR, LEVELS, THREAD
from fabricusd.appearance.published.far import far_values
from fabricusd.appearance.published.levels import POINT_ROWS, point_block, point_values
from fabricusd.appearance.scattering.models import any_published
from fabricusd.appearance.shadow.kinds import METHODS, Shadow
from fabricusd.appearance.shadow.methods import compile_shadow, horizon_block, lit_all, mean_block
from fabricusd.appearance.shadow.place_blocks import (
    ANGLE,
    INT_ROWS,
    LIT,
    OF_SET,
    OF_THREAD,
    REAL_ROWS,
    S,
    look_up_block,
)
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.appearance.weave.lookup import WeaveHit, lookup
from fabricusd.appearance.weave.place import Places, place_at
from fabricusd.appearance.weave.yarn.compiled import Yarn, compile_yarn
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import BLOCK, KERNEL, index

Floats = NDArray[np.float64]

_CHUNK = 32 * BLOCK
"""Number of directions that a worker takes at a time."""


class Sample(NamedTuple):
    """Directions drawn for given viewers.

    wi : (n, 3) float - unit vectors in the surface frame
    f : (n, 3) float - radiance per unit `L_i dwi`, cosine included
    pdf : (n,) float - density of wi [1/sr]; 0, with f = 0, if no direction can be drawn
    """

    wi: Floats
    f: Floats
    pdf: Floats


def mean_shadow(fabric: Fabric) -> str:
    """The shadow that level `far` of this cloth takes the mean of: "horizon" under a law that does
    not mask, else "none", since the mask already contains it."""
    return "horizon" if law_of(fabric).absolute else "none"


def evaluate(
    fabric: Fabric,
    wi: ArrayLike,
    wo: ArrayLike,
    uv: ArrayLike | None = None,
    level: str = "far",
    shadow: str = "none",
    *,
    max_error: float | None = None,
    multiple: bool = True,
) -> Floats:
    """(n, 3) radiance per unit `L_i dwi` towards wo, cosine included.

    wi, wo : (n, 3) unit vectors in the surface frame, or one (3,) for all
    uv : (n, 2) weave coordinates in threads (ends along U, picks along V), or (2,) for all;
        required at levels `weave` and `thread`
    level : one of LEVELS
    shadow : one of `shadow.METHODS`; at level `far` its mean under a surface law that does not
        mask, and ignored under the others
    max_error : bound on the mean relative error of the quadrature over the curves, see
        `accuracy.choose_rule`; None takes `quadrature.default_rule`
    multiple : whether `conserving` cloth scatters light more than once

    Raises FabricError for directions that are not finite unit vectors, for an unknown level or
    shadowing method, for coordinates that are missing or not finite, and for a bound that cannot be
    met.
    """
    i, o = _pairs(wi, wo, uv if level != "far" else None)
    hit, places = _places(fabric, uv, level, i.shape[1])
    _check_shadow(shadow)
    out = _evaluate(_law(fabric, shadow, max_error, multiple), level, hit, i, o)
    if level != "far" and shadow != "none":
        out *= _lit(fabric, shadow, places, i)
    under_fuzz(fabric, level, hit, i, o, out)
    return np.ascontiguousarray(out.T)


def pdf(
    fabric: Fabric,
    wi: ArrayLike,
    wo: ArrayLike,
    uv: ArrayLike | None = None,
    level: str = "far",
    shadow: str = "none",
) -> Floats:
    """(n,) density [1/sr] with which `sample` draws wi for the viewer wo.

    The density does not depend on the shadowing. Arguments and errors are those of `evaluate`.
    """
    i, o = _pairs(wi, wo, uv if level != "far" else None)
    hit, _ = _places(fabric, uv, level, i.shape[1])
    _check_shadow(shadow)
    return _density(_law(fabric, shadow), level, hit, i, o)


def sample(
    fabric: Fabric,
    wo: ArrayLike,
    u: ArrayLike,
    uv: ArrayLike | None = None,
    level: str = "far",
    shadow: str = "none",
) -> Sample:
    """Directions towards the light for the viewers wo, with `f/pdf` as even as the lobes allow.

    wo : (n, 3) unit vectors in the surface frame, or (3,) for all
    u : (n, 3) numbers in [0, 1): lobe, inclination, azimuth

    The other arguments and the errors are those of `evaluate`.
    """
    numbers = np.atleast_2d(np.asarray(u, np.float64))
    if numbers.ndim != 2 or numbers.shape[1] != 3:
        raise FabricError("u", f"has shape {numbers.shape}; it must be (n, 3)")
    bad = int(np.count_nonzero(~((numbers >= 0) & (numbers <= 1))))
    if bad:
        raise FabricError("u", f"holds {bad} number(s) outside 0 to 1")
    o = _repeated(_directions("wo", wo), len(numbers), "wo")
    hit, places = _places(fabric, uv, level, len(numbers))
    _check_shadow(shadow)
    law = _law(fabric, shadow)
    i = np.empty_like(o)
    real: Any = np.float64
    turned = np.ascontiguousarray(numbers.T)
    _draw(real, *law, LEVELS.index(level), hit.places, o, turned, i)
    f = _evaluate(law, level, hit, i, o)
    if level != "far" and shadow != "none":
        f *= _lit(fabric, shadow, places, i)
    under_fuzz(fabric, level, hit, i, o, f)
    p = _density(law, level, hit, i, o)
    return Sample(np.ascontiguousarray(i.T), np.ascontiguousarray(f.T), p)


def under_fuzz(
    fabric: Fabric, level: str, hit: WeaveHit, wi: Floats, wo: Floats, out: Floats
) -> None:
    """Lay the fuzz of `fabric` over the values out (3, n) of its cloth; see `fuzz`."""
    fuzz = fuzz_of(fabric, np.float64)
    if fuzz is None:
        return
    rows = fuzz_rows(fabric, level, hit.set, hit.thread)
    real: Any = np.float64
    fuzz_over_all(real, *fuzz, rows, wi, wo, out)


def fuzz_rows(fabric: Fabric, level: str, thread_set: Any, thread: Any) -> NDArray[np.int64]:
    """(n,) rows of `Fuzz.phase` for threads at places; (1,) at level `far`."""
    if level == "far":
        return np.array([len(fabric.threads)])
    return np.where(np.asarray(thread_set) == GAP, -1, np.asarray(thread)).astype(np.int64)


@lru_cache(maxsize=32)
def fuzz_of(fabric: Fabric, precision: type[Any]) -> Fuzz | None:
    """The fuzz over the cloth of `fabric`, in `precision`; None where its threads have none."""
    if optical_depth(fabric) == 0.0:
        return None
    return compile_fuzz(fabric, _diffuse(bald(fabric)), precision)


def _diffuse(fabric: Fabric) -> Floats:
    """(2, 3) shares of diffuse light that cloth reflects, and that it transmits as threads do."""
    if not any_published(fabric):
        layer = layer_of(fabric)
        shares = layer.of(np.array([t.albedo for t in fabric.thread_list]))[1]
        return np.asarray(shares - np.array([[0.0], [layer.gap[1]]]))
    x, w = np.polynomial.legendre.leggauss(6)
    mu, weight = 0.5 * (x + 1.0), 0.5 * w
    phi = (np.arange(12) + 0.5) * (math.pi / 6)
    z, turn = (a.ravel() for a in np.meshgrid(mu, phi, indexing="ij"))
    flat, share = np.sqrt(1.0 - z * z), np.repeat(weight, 12) * (2 * math.pi / 12)
    above = np.stack((flat * np.cos(turn), flat * np.sin(turn), z), axis=-1)
    # A quarter of the azimuths: the values differ little from turn to turn.
    views = np.arange(0, len(z), 4)
    to_viewer = np.repeat(above[views], len(z), axis=0)
    cosine = share[views] * z[views]
    found = np.zeros((2, 3))
    for side, lights in enumerate((above, above * [1.0, 1.0, -1.0])):
        to_light = np.tile(lights, (len(views), 1))
        f = evaluate(fabric, to_light, to_viewer, shadow=mean_shadow(fabric))
        seen = np.einsum("vnc,n->vc", f.reshape(len(views), len(z), 3), share)
        found[side] = cosine @ seen / cosine.sum()
    return found


def _density(law: SurfaceLaw, level: str, hit: WeaveHit, wi: Floats, wo: Floats) -> Floats:
    real: Any = np.float64
    out = np.empty(wi.shape[1])
    _densities(real, *law, LEVELS.index(level), hit.places, wi, wo, out)
    return out


def _law(
    fabric: Fabric,
    shadow: str,
    max_error: float | None = None,
    multiple: bool = True,
) -> SurfaceLaw:
    held = shadow if law_of(fabric).absolute else "none"
    return _kept_law(fabric, held, max_error, multiple)


@lru_cache(maxsize=32)
def _kept_law(fabric: Fabric, shadow: str, max_error: float | None, multiple: bool) -> SurfaceLaw:
    rule = None if max_error is None else choose_rule(fabric, max_error)
    kept = _shadowed(fabric, shadow)[1] if shadow != "none" else None
    return surface_law(fabric, precision=np.float64, rule=rule, multiple=multiple, shadow=kept)


@lru_cache(maxsize=32)
def _shadowed(fabric: Fabric, method: str) -> tuple[CompiledFabric, Shadow]:
    return (
        compile_fabric(fabric, precision=np.float64),
        compile_shadow(fabric, method, precision=np.float64),
    )


def _lit(fabric: Fabric, method: str, uv: Floats, wi: Floats) -> Floats:
    """(n,) factor of `shadow.shade` at each place, for light from wi (3, n)."""
    cloth, shadow = _shadowed(fabric, method)
    out = np.empty(len(uv))
    real: Any = np.float64
    lit_all(real, cloth, shadow, True, uv, wi, out)
    return out


def _check_shadow(method: str) -> None:
    if method not in METHODS:
        raise FabricError("shadow", f"is '{method}'; it must be one of {', '.join(METHODS)}")


def places_of(fabric: Fabric, uv: Floats) -> WeaveHit:
    """What level `weave` finds at weave coordinates uv (n, 2)."""
    return _places(fabric, uv, "weave", len(uv))[0]


def _places(
    fabric: Fabric, uv: ArrayLike | None, level: str, count: int
) -> tuple[WeaveHit, Floats]:
    """The hit at each of `count` places, and the places (count, 2) of the even cloth that look as
    they do; a single dummy for `far`."""
    if level not in LEVELS:
        raise FabricError("level", f"is '{level}'; it must be one of {', '.join(LEVELS)}")
    if level == "far":
        anywhere = np.zeros((1, 2))
        return lookup(_cloth(fabric), anywhere), anywhere
    if uv is None:
        raise FabricError("uv", f"is missing; level {level} requires weave coordinates, (n, 2)")
    places = np.atleast_2d(np.asarray(uv, np.float64))
    if places.ndim != 2 or places.shape[1] != 2 or len(places) not in (1, count):
        raise FabricError("uv", f"has shape {places.shape}; it must be ({count}, 2) or (2,)")
    places = np.ascontiguousarray(np.broadcast_to(places, (count, 2)))
    hit = lookup(_cloth(fabric), places, _yarn(fabric))
    return hit, hit.even_uv


@lru_cache(maxsize=32)
def _cloth(fabric: Fabric) -> CompiledFabric:
    return compile_fabric(fabric, precision=np.float64)


@lru_cache(maxsize=32)
def _yarn(fabric: Fabric) -> Yarn | None:
    return compile_yarn(fabric, precision=np.float64) if fabric.is_uneven else None


def _directions(name: str, w: ArrayLike) -> Floats:
    """(3, n) vectors, normalised to rounding, from (n, 3) or (3,)."""
    rows = np.atleast_2d(np.asarray(w, np.float64))
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise FabricError(name, f"has shape {rows.shape}; it must be (n, 3)")
    bad = ~np.isfinite(rows).all(axis=1)
    if bad.any():
        raise FabricError(
            name,
            f"has {int(bad.sum())} of {len(rows)} directions that are not finite, the first at "
            f"{int(np.argmax(bad))}",
        )
    length = np.linalg.norm(rows, axis=1)
    off = np.abs(length - 1.0)
    if off.size and off.max() > 1e-3:
        k = int(off.argmax())
        raise FabricError(f"{name} {k}", f"has length {length[k]:.6g}; it must be a unit vector")
    return np.ascontiguousarray((rows / length[:, None]).T)


def _repeated(w: Floats, count: int, name: str) -> Floats:
    if w.shape[1] == count:
        return w
    if w.shape[1] != 1:
        raise FabricError(name, f"has {w.shape[1]} directions; it must have {count} or 1")
    return np.repeat(w, count, axis=1)


def _pairs(wi: ArrayLike, wo: ArrayLike, uv: ArrayLike | None) -> tuple[Floats, Floats]:
    """Both arguments as (3, n); a single direction is repeated to match the others or the
    places."""
    i, o = _directions("wi", wi), _directions("wo", wo)
    places = 1 if uv is None else len(np.atleast_2d(np.asarray(uv)))
    n = next((k for k in (i.shape[1], o.shape[1], places) if k != 1), 1)
    return _repeated(i, n, "wi"), _repeated(o, n, "wo")


def _evaluate(law: SurfaceLaw, level: str, hit: WeaveHit, wi: Floats, wo: Floats) -> Floats:
    """(3, n) values, of the published models by the vectorised loops, of the others one by one."""
    real: Any = np.float64
    out = np.zeros_like(wi)
    if law.kind != CONSERVING_ONLY:
        if level == "far":
            far_all(real, law.published, wi, wo, out)
        else:
            points_all(real, law.published, level == "thread", hit.places, wi, wo, out)
    if law.kind != PUBLISHED_ONLY:
        conserving_all(real, law.conserving, LEVELS.index(level), hit.places, wi, wo, out)
    return out


@njit(**KERNEL, parallel=True)
def far_all(R, tables, wi, wo, out):  # type: ignore[no-untyped-def]
    """Level `far` of all pairs, on all workers: wi, wo, out are (3, n) of precision R."""
    n = wi.shape[1]
    for chunk in prange((n + _CHUNK - 1) // _CHUNK):
        far_values(R, tables, wi, wo, out, chunk * _CHUNK, min(n, (chunk + 1) * _CHUNK))


@njit(**KERNEL, parallel=True)
def points_all(R, tables, across_too, places, wi, wo, out):  # type: ignore[no-untyped-def]
    """Level `weave`, or `thread` if `across_too`, at n `Places`, on all workers.

    wi, wo, out : (3, n) of precision R, as in `levels.point_values`
    """
    n = wi.shape[1]
    for chunk in prange((n + _CHUNK - 1) // _CHUNK):
        first, last = chunk * _CHUNK, min(n, (chunk + 1) * _CHUNK)
        point_values(R, tables, across_too, places, wi, wo, out, first, last)


@njit(**KERNEL, parallel=True)
def weave_all(R, cloth, shadow, tables, uv, wi, wo, out):
    """Level `weave` shadowed by the `horizon` table, at places that are each looked up once.

    cloth, shadow, tables : compiled for precision R, the shadow by "horizon"
    uv : (n, 2) float64 weave coordinates; wi, wo, out : (3, n) of precision R
    """
    n = uv.shape[0]
    for chunk in prange((n + _CHUNK - 1) // _CHUNK):
        first, last = chunk * _CHUNK, min(n, (chunk + 1) * _CHUNK)
        _weave_chunk(R, cloth, shadow, tables, uv, wi, wo, out, first, last)


@njit(**KERNEL)
def _weave_chunk(R, cloth, shadow, tables, uv, wi, wo, out, first, last):
    ints, reals = np.empty(INT_ROWS * BLOCK, np.int32), np.empty(REAL_ROWS * BLOCK, R)
    block = np.empty(POINT_ROWS * BLOCK, R)
    for begin in range(first, last, BLOCK):
        size = min(BLOCK, last - begin)
        look_up_block(R, cloth, shadow, uv, begin, size, ints, reals)
        horizon_block(R, cloth, shadow, wi, begin, size, ints, reals)
        mean_block(R, cloth, shadow, wi, begin, size, ints, reals)
        # Level `weave` does not read the position across: any row will do.
        places = Places(ints[OF_SET:], ints[OF_THREAD:], reals[ANGLE:], reals[S:], reals[:0])
        point_block(R, tables, False, places, 0, wi, wo, out, begin, size, block)
        for c in range(3):
            for k in range(size):
                out[c, index(begin, k)] *= reals[LIT + k]


@njit(**KERNEL, parallel=True)
def conserving_all(R, tables, level, places, wi, wo, out):  # type: ignore[no-untyped-def]
    """Add the values of the conserving law at a level to out, on all workers.

    level : FAR, WEAVE or THREAD; places : n `Places`, not read at FAR; wi, wo, out : (3, n)
    """
    n = wi.shape[1]
    for chunk in prange((n + BLOCK - 1) // BLOCK):
        first, last = chunk * BLOCK, min(n, (chunk + 1) * BLOCK)
        _add_conserving(R, tables, level, places, wi, wo, out, first, last)


@njit(**KERNEL)
def _add_conserving(R, tables, level, places, wi, wo, out, first, last):  # type: ignore[no-untyped-def]
    values = np.empty((3, last - first), wi.dtype)
    i, o = wi[:, first:last], wo[:, first:last]
    if level == FAR:
        conserving_far_values(R, tables, i, o, values, 0, last - first)
    else:
        ours = Places(
            places.sets[first:last], places.threads[first:last], places.psi0[first:last],
            places.w[first:last], places.shade[first:last],
        )  # fmt: skip
        conserving_point_values(R, tables, level == THREAD, ours, i, o, values, 0, last - first)
    for channel in range(3):
        for k in range(last - first):
            out[channel, first + k] += values[channel, k]


# numba's parallel loops cannot take a tuple of tuples, so the law is passed in parts.


@njit(**KERNEL, parallel=True)
def _densities(R, kind, a, b, c, d, level, places, wi, wo, out):  # type: ignore[no-untyped-def]
    n = out.size
    for chunk in prange((n + BLOCK - 1) // BLOCK):
        first, last = chunk * BLOCK, min(n, (chunk + 1) * BLOCK)
        law = SurfaceLaw(kind, a, b, c, d)
        _chunk_densities(R, law, level, places, wi, wo, out, first, last)


@njit(**KERNEL)
def _chunk_densities(R, law, level, places, wi, wo, out, first, last):  # type: ignore[no-untyped-def]
    for k in range(first, last):
        x = k if level != FAR else 0
        out[k] = law_density(
            R, law, level, place_at(places, x),
            wi[0, k], wi[1, k], wi[2, k], wo[0, k], wo[1, k], wo[2, k],
        )  # fmt: skip


@njit(**KERNEL, parallel=True)
def _draw(R, kind, a, b, c, d, level, places, wo, u, wi):  # type: ignore[no-untyped-def]
    n = wi.shape[1]
    for chunk in prange((n + BLOCK - 1) // BLOCK):
        first, last = chunk * BLOCK, min(n, (chunk + 1) * BLOCK)
        law = SurfaceLaw(kind, a, b, c, d)
        _chunk_draw(R, law, level, places, wo, u, wi, first, last)


@njit(**KERNEL)
def _chunk_draw(R, law, level, places, wo, u, wi, first, last):  # type: ignore[no-untyped-def]
    for k in range(first, last):
        x = k if level != FAR else 0
        wi[0, k], wi[1, k], wi[2, k] = law_direction(
            R, law, level, place_at(places, x),
            wo[0, k], wo[1, k], wo[2, k], u[0, k], u[1, k], u[2, k],
        )  # fmt: skip

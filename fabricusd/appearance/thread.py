"""Evaluate and sample a single thread; also the columns and kernels that other tools use.

Directions are unit vectors in the thread frame: x along the thread's tangent, z along its normal
(`frame`). `f_s` is per steradian and carries no cosine; a light contributes `f_s L_i cos(theta_i)`
to the radiance, with the cosine of the inclination, `sqrt(1 - x^2)`. A thread scatters over the
whole sphere.

    evaluate, sample, pdf        (n, 3) float64 arrays of directions; exact to rounding
    split                        the two terms apart, for fits: on the calling thread, fast tables
    evaluate_soa                 (3, n) arrays of either precision; the fast loop
    terms, density, ...          scalar kernels on a row of `pack_threads`
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from fabricusd.appearance.scattering.columns import (
    ALBEDO_B,
    ALBEDO_G,
    ALBEDO_R,
    BRIGHTNESS,
    CONSTANTS,
    GAMMA_SURFACE,
    GAMMA_VOLUME,
    IOR_EXCESS,
    ISOTROPIC,
    MODEL,
    SURFACE_GAIN,
    TRANSMISSION_ENTRIES,
)
from fabricusd.appearance.scattering.models import REGISTRY
from fabricusd.appearance.scattering.sampling import density, sample_direction
from fabricusd.appearance.scattering.table import pack_threads, thread_row
from fabricusd.appearance.scattering.terms import (
    ALL,
    factors,
    lobes,
    looked_up,
    pair_angles,
    terms,
    terms_at,
)
from fabricusd.errors import FabricError
from fabricusd.fabric import DEFAULT_MODEL, MODELS, Thread
from fabricusd.kernels.choice import specialised
from fabricusd.kernels.real import INLINE, KERNEL
from fabricusd.kernels.unrolled import tuple_reader

__all__ = [
    "ALBEDO_B",
    "ALBEDO_G",
    "ALBEDO_R",
    "BRIGHTNESS",
    "GAMMA_SURFACE",
    "GAMMA_VOLUME",
    "IOR_EXCESS",
    "ISOTROPIC",
    "MODEL",
    "SURFACE_GAIN",
    "Sample",
    "density",
    "evaluate",
    "evaluate_soa",
    "pack_threads",
    "pdf",
    "sample",
    "sample_direction",
    "split",
    "terms",
    "terms_at",
    "thread_row",
]

Reals = NDArray[Any]
Floats = NDArray[np.float64]

CHUNK = 4096
"""Number of directions that a worker takes at a time: 150 kB in float32, which fit in its cache."""


SPLIT_ENTRIES = 91
"""Entries that `split` computes of the tables of the conserving model, in a sixth of the time. The
others are interpolated: up to 85 degrees of inclination `f_s` is then 1e-4 off (rms), at most 4e-4,
with a volume lobe of 24 degrees, and 6e-4, at most 4e-3, with one of 2 degrees."""


class Terms(NamedTuple):
    """`f_s = surface + volume A` per channel [1/sr].

    surface, volume : (n,) float
    """

    surface: Floats
    volume: Floats


class Sample(NamedTuple):
    """Directions drawn for given viewers.

    wi : (n, 3) float - unit vectors in the thread frame
    f : (n, 3) float - `f_s(wi, wo)` [1/sr], without the cosine
    pdf : (n,) float - density of wi [1/sr], above 0
    """

    wi: Floats
    f: Floats
    pdf: Floats


def evaluate(thread: Thread, wi: ArrayLike, wo: ArrayLike, model: str | None = None) -> Floats:
    """(n, 3) `f_s(wi, wo)` [1/sr] per channel, without the cosine; never negative, always finite.

    wi, wo : (n, 3) unit vectors in the thread frame, or (3,) for all
    model : one of `fabric.MODELS`; None takes the thread's model, or the default if it has none

    Raises FabricError for directions that are not finite or not of length 1, and for unknown
    models.
    """
    i, o = _pairs(wi, wo)
    out = np.empty_like(i)
    _evaluate_soa(np.float64, thread_row(thread, _model_of(thread, model)), i, o, out)
    return np.ascontiguousarray(out.T)


def split(
    thread: Thread, wi: ArrayLike, wo: ArrayLike, model: str | None = None, *, exact: bool = False
) -> Terms:
    """The two terms of `evaluate`, which does not depend on the albedo otherwise.

    exact : compute all entries of the model's tables, see SPLIT_ENTRIES; only the conserving model
        has any

    It runs on the calling thread and releases Python's lock, so that many fits can run beside one
    another. It is smooth in the thread's parameters: steps of 1e-6 give derivatives. Arguments and
    errors are those of `evaluate`.
    """
    i, o = _pairs(wi, wo)
    surface, volume = np.empty(i.shape[1]), np.empty(i.shape[1])
    name = _model_of(thread, model)
    row = thread_row(thread, name, TRANSMISSION_ENTRIES if exact else SPLIT_ENTRIES)
    _split(np.float64, row, i, o, surface, volume)
    return Terms(surface, volume)


def pdf(thread: Thread, wi: ArrayLike, wo: ArrayLike, model: str | None = None) -> Floats:
    """(n,) density [1/sr] with which `sample` draws wi for the viewer wo; it integrates to 1.

    Arguments and errors are those of `evaluate`.
    """
    i, o = _pairs(wi, wo)
    out = np.empty(i.shape[1])
    _density_soa(np.float64, thread_row(thread, _model_of(thread, model)), i, o, out)
    return out


def sample(thread: Thread, wo: ArrayLike, u: ArrayLike, model: str | None = None) -> Sample:
    """Directions towards the light for the viewers wo, with `f cos(theta_i)/pdf` nearly even.

    wo : (n, 3) unit vectors in the thread frame, or (3,) for all
    u : (n, 3) numbers in [0, 1): lobe, inclination, azimuth

    Raises FabricError as `evaluate` does, and for numbers outside [0, 1].
    """
    numbers = np.atleast_2d(np.asarray(u, np.float64))
    if numbers.ndim != 2 or numbers.shape[1] != 3:
        raise FabricError("u", f"has shape {numbers.shape}; it must be (n, 3)")
    bad = int(np.count_nonzero(~((numbers >= 0) & (numbers <= 1))))
    if bad:
        raise FabricError("u", f"holds {bad} number(s) outside 0 to 1")
    o = _directions("wo", wo)
    if o.shape[1] == 1:
        o = np.repeat(o, len(numbers), axis=1)
    if o.shape[1] != len(numbers):
        raise FabricError("u", f"has {len(numbers)} rows and wo {o.shape[1]}; they must agree")
    row = thread_row(thread, _model_of(thread, model))
    i, f, p = np.empty_like(o), np.empty_like(o), np.empty(o.shape[1])
    _sample_soa(np.float64, row, o, np.ascontiguousarray(numbers.T), i)
    _evaluate_soa(np.float64, row, i, o, f)
    _density_soa(np.float64, row, i, o, p)
    return Sample(np.ascontiguousarray(i.T), np.ascontiguousarray(f.T), p)


def evaluate_soa(row: Reals, wi: Reals, wo: Reals, out: Reals | None = None) -> Reals:
    """`evaluate` on structures of arrays, on all workers, without checks or copies.

    row : one row of `pack_threads`; wi, wo, out : (3, n) C-contiguous, all of the row's precision

    Returns `out`, which is allocated if not given: (3, n) `f_s` [1/sr].
    """
    if out is None:
        out = np.empty_like(wi)
    _evaluate_soa(row.dtype.type, row, wi, wo, out)
    return out


def _model_of(thread: Thread, model: str | None) -> str:
    name = model or thread.model or DEFAULT_MODEL
    if name not in MODELS:
        raise FabricError("model", f"is '{name}'; it must be one of {', '.join(MODELS)}")
    return name


def _directions(name: str, w: ArrayLike) -> Floats:
    """(3, n) vectors, normalised to rounding, from (n, 3) or (3,)."""
    rows = np.atleast_2d(np.asarray(w, np.float64))
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise FabricError(name, f"has shape {rows.shape}; it must be (n, 3)")
    bad = int(np.count_nonzero(~np.isfinite(rows).all(axis=1)))
    if bad:
        raise FabricError(name, f"holds {bad} direction(s) that are not finite")
    length = np.linalg.norm(rows, axis=1)
    off = np.abs(length - 1.0)
    if off.size and off.max() > 1e-3:
        k = int(off.argmax())
        raise FabricError(f"{name} {k}", f"has length {length[k]:.6g}; it must be a unit vector")
    return np.ascontiguousarray((rows / length[:, None]).T)


def _pairs(wi: ArrayLike, wo: ArrayLike) -> tuple[Floats, Floats]:
    """Both arguments as (3, n); a single direction is repeated to match the other argument."""
    i, o = _directions("wi", wi), _directions("wo", wo)
    n = max(i.shape[1], o.shape[1])
    if i.shape[1] == 1:
        i = np.repeat(i, n, axis=1)
    if o.shape[1] == 1:
        o = np.repeat(o, n, axis=1)
    if i.shape != o.shape:
        raise FabricError("wi", f"has {i.shape[1]} directions and wo {o.shape[1]}; they must agree")
    return i, o


# In the loops below wi, wo and out are tuples of three (n,) rows. The row's constants come from a
# tuple as well: if the loops loaded them from an array, LLVM would have to assume that every store
# into `out` may change them, and would not vectorise.


_constants = tuple_reader(CONSTANTS)

_HAS_TABLE = tuple(model.looked_up is not None for model in REGISTRY)


@njit(**INLINE)
def _direct_loop(R, model, row, wi, wo, out):
    ix, iy, iz = wi
    ox, oy, oz = wo
    r, g, b = out
    for k in range(ix.size):
        cos_i, cos_o, cos_half = pair_angles(R, iy[k], iz[k], oy[k], oz[k])
        surface, volume = factors(R, model, row, ix[k], cos_i, ox[k], cos_o, cos_half)
        on_surface, on_volume = lobes(R, model, row, ix[k], cos_i, ox[k], cos_o)
        surface, volume = surface * on_surface, volume * on_volume
        r[k] = surface + volume * row[ALBEDO_R]
        g[k] = surface + volume * row[ALBEDO_G]
        b[k] = surface + volume * row[ALBEDO_B]


@njit(**INLINE)
def _table_loop(R, model, row, scale, added, wi, wo, out):
    ix, iy, iz = wi
    ox, oy, oz = wo
    r, g, b = out
    for k in range(ix.size):
        cos_i, cos_o, cos_half = pair_angles(R, iy[k], iz[k], oy[k], oz[k])
        surface, volume = factors(R, model, row, ix[k], cos_i, ox[k], cos_o, cos_half)
        on_surface, on_volume = lobes(R, model, row, ix[k], cos_i, ox[k], cos_o)
        surface, volume = surface * on_surface, volume * on_volume * scale[k] + added[k]
        r[k] = surface + volume * row[ALBEDO_R]
        g[k] = surface + volume * row[ALBEDO_G]
        b[k] = surface + volume * row[ALBEDO_B]


_directly = specialised(_direct_loop, [k for k in ALL if not _HAS_TABLE[k]])
_by_table = specialised(_table_loop, [k for k in ALL if _HAS_TABLE[k]])


@njit(**KERNEL)
def _direct_block(R, model, row, wi, wo, out):
    _directly(R, model, row, wi, wo, out)


@njit(**KERNEL)
def _table_block(R, model, row, scale, added, wi, wo, out):
    _by_table(R, model, row, scale, added, wi, wo, out)


@njit(**KERNEL)
def _looked_up_block(R, model, row, wi, wo, scale, added):
    """The values that models look up in tables, in a loop of their own: the loops above then
    contain no gathers."""
    _, iy, iz = wi
    _, oy, oz = wo
    for k in range(scale.size):
        cos_i, cos_o, _ = pair_angles(R, iy[k], iz[k], oy[k], oz[k])
        scale[k], added[k] = looked_up(R, model, row, cos_i, cos_o)


@njit(**KERNEL, parallel=True)
def _evaluate_soa(R, row, wi, wo, out):
    n = wi.shape[1]
    constants = _constants(row, 0)
    model = int(row[MODEL])
    for block in prange((n + CHUNK - 1) // CHUNK):
        s = slice(block * CHUNK, min(n, (block + 1) * CHUNK))
        i, o = (wi[0, s], wi[1, s], wi[2, s]), (wo[0, s], wo[1, s], wo[2, s])
        channels = (out[0, s], out[1, s], out[2, s])
        if _HAS_TABLE[model]:
            size = out[0, s].size
            scale, added = np.empty(size, R), np.empty(size, R)
            _looked_up_block(R, model, row, i, o, scale, added)
            _table_block(R, model, constants, scale, added, i, o, channels)
        else:
            _direct_block(R, model, constants, i, o, channels)


@njit(**KERNEL)
def _split(R, row, wi, wo, surface, volume):
    for k in range(surface.size):
        surface[k], volume[k] = terms(
            R, row, wi[0, k], wi[1, k], wi[2, k], wo[0, k], wo[1, k], wo[2, k]
        )


@njit(**KERNEL, parallel=True)
def _density_soa(R, row, wi, wo, out):
    for k in prange(out.size):
        out[k] = density(R, row, wi[0, k], wi[1, k], wi[2, k], wo[0, k], wo[1, k], wo[2, k])


@njit(**KERNEL, parallel=True)
def _sample_soa(R, row, wo, u, wi):
    for k in prange(u.shape[1]):
        x, y, z = sample_direction(R, row, wo[0, k], wo[1, k], wo[2, k], u[0, k], u[1, k], u[2, k])
        wi[0, k], wi[1, k], wi[2, k] = x, y, z

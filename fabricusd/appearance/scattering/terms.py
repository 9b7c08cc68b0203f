"""Kernels for the surface and the volume term of a thread, whichever model it has.

Each model is a module of `scattering.models`. This module combines their parts and selects them by
the number in the column MODEL of a row. `model.ThreadModel` defines the terms.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from numba import njit

from fabricusd.appearance.frame import cos_half_difference, cos_inclination, unit_azimuth
from fabricusd.appearance.scattering.columns import MODEL
from fabricusd.appearance.scattering.models import CONSERVING_MODELS, PUBLISHED_MODELS, REGISTRY
from fabricusd.kernels.choice import by_number
from fabricusd.kernels.real import INLINE

ALL = range(len(REGISTRY))
CELL_MODELS = tuple(k for k in PUBLISHED_MODELS if REGISTRY[k].cell_lobes is not None)


@njit(**INLINE)
def _nowhere(R, cos_theta):
    return R(0)


@njit(**INLINE)
def _nothing_read(R, row, position):
    return R(1), R(0)


@njit(**INLINE)
def _nothing_looked_up(R, row, first_i, second_i, first_o, second_o):
    return R(1), R(0)


_WITHOUT = {"position": _nowhere, "read": _nothing_read, "looked_up": _nothing_looked_up}


def _parts(name: str, numbers: Iterable[int]) -> Any:
    """A kernel (R, model, row, ...) that selects one field of `ThreadModel` by the model's
    number."""
    return by_number({k: getattr(REGISTRY[k], name) or _WITHOUT.get(name) for k in numbers})


factors, lobes = _parts("factors", ALL), _parts("lobes", ALL)
_position, _read, _looked_up = (_parts(name, ALL) for name in ("position", "read", "looked_up"))
energies = _parts("energies", ALL)
published_factors = _parts("factors", PUBLISHED_MODELS)
published_lobes = _parts("lobes", PUBLISHED_MODELS)
cell_lobes = _parts("cell_lobes", CELL_MODELS)
_conserving_factors = _parts("factors", CONSERVING_MODELS)
_conserving_lobes = _parts("lobes", CONSERVING_MODELS)
conserving_position = _parts("position", CONSERVING_MODELS)
conserving_read = _parts("read", CONSERVING_MODELS)
_conserving_looked_up = _parts("looked_up", CONSERVING_MODELS)
"""Each of these takes (R, model, row, ...) as in `ThreadModel`. Kernels that serve one law select
among the models of that law only, so they do not contain the code of the others."""


@njit(**INLINE)
def looked_up(R, model, row, cos_i, cos_o):
    """(factor, addend) of the volume term that a model reads from tables."""
    first_i, second_i = _read(R, model, row, _position(R, model, cos_i))
    first_o, second_o = _read(R, model, row, _position(R, model, cos_o))
    return _looked_up(R, model, row, first_i, second_i, first_o, second_o)


@njit(**INLINE)
def terms_at(R, row, sin_i, cos_i, sin_o, cos_o, cos_half):
    """(surface, volume) [1/sr] of the row's model, from the sines and cosines of the angles.

    row : (COLUMNS,) of the thread table
    """
    model = int(row[MODEL])
    surface, volume = factors(R, model, row, sin_i, cos_i, sin_o, cos_o, cos_half)
    on_surface, on_volume = lobes(R, model, row, sin_i, cos_i, sin_o, cos_o)
    scale, added = looked_up(R, model, row, cos_i, cos_o)
    return surface * on_surface, volume * on_volume * scale + added


@njit(**INLINE)
def pair_angles(R, iy, iz, oy, oz):
    """(cos theta_i, cos theta_o, cos(phi_d/2)) from y and z of two directions in the thread
    frame."""
    cos_i = cos_inclination(R, iy, iz)
    cos_o = cos_inclination(R, oy, oz)
    sin_phi_i, cos_phi_i = unit_azimuth(R, iy, iz, cos_i)
    sin_phi_o, cos_phi_o = unit_azimuth(R, oy, oz, cos_o)
    return cos_i, cos_o, cos_half_difference(R, sin_phi_i, cos_phi_i, sin_phi_o, cos_phi_o)


@njit(**INLINE)
def terms(R, row, ix, iy, iz, ox, oy, oz):
    """(surface, volume) [1/sr] for two unit vectors in the thread frame (t, b, n_t)."""
    cos_i, cos_o, cos_half = pair_angles(R, iy, iz, oy, oz)
    return terms_at(R, row, ix, cos_i, ox, cos_o, cos_half)


@njit(**INLINE)
def conserving_terms(R, row, ix, iy, iz, ox, oy, oz):
    """`terms` of a thread that follows the conserving law."""
    model = int(row[MODEL])
    cos_i, cos_o = cos_inclination(R, iy, iz), cos_inclination(R, oy, oz)
    first_i, second_i = conserving_read(R, model, row, conserving_position(R, model, cos_i))
    first_o, second_o = conserving_read(R, model, row, conserving_position(R, model, cos_o))
    return conserving_terms_read(
        R, row, first_i, second_i, first_o, second_o, ix, iy, iz, ox, oy, oz
    )


@njit(**INLINE)
def conserving_terms_read(R, row, first_i, second_i, first_o, second_o, ix, iy, iz, ox, oy, oz):
    """`conserving_terms`, given what `conserving_read` gives for both directions."""
    model = int(row[MODEL])
    cos_i, cos_o, cos_half = pair_angles(R, iy, iz, oy, oz)
    surface, volume = _conserving_factors(R, model, row, ix, cos_i, ox, cos_o, cos_half)
    on_surface, on_volume = _conserving_lobes(R, model, row, ix, cos_i, ox, cos_o)
    scale, added = _conserving_looked_up(R, model, row, first_i, second_i, first_o, second_o)
    return surface * on_surface, volume * on_volume * scale + added

"""Finding the lights that rays pass before their first triangle, one block of rays at a time.

Within each loop the light's kind is constant, so LLVM vectorises the loops.
"""

from __future__ import annotations

from numba import njit

from fabricusd.kernels.real import PART
from fabricusd.reference.lights.kinds import KINDS
from fabricusd.reference.lights.ray_block import SEEN_B, SEEN_R, R
from fabricusd.reference.lights.row import KIND, VISIBLE
from fabricusd.reference.rays.wave import BLOCK


def _first_of(kinds):
    """Make a kernel that calls `meet` of a light's kind, as in `sampling._first_of`."""
    if not kinds:
        return _none
    (number, module), *others = kinds
    meet, otherwise = module.meet, _first_of(others)

    @njit(**PART)
    def choose(kind, light, dome, size, block):
        if kind == number:
            meet(light, dome, size, block)
        else:
            otherwise(kind, light, dome, size, block)

    return choose


@njit(**PART)
def _none(kind, light, dome, size, block):
    """The end of the chain, never reached: `kinds` makes sure that every kind has a module."""


_meet_of_kind = _first_of(list(KINDS.items()))


@njit(**PART)
def meet_lights(lights, dome, all_first, size, block):
    """Fill rows SEEN_R to SEEN_B of `size` rays with the radiance of all lights that they pass.

    Each light is weighted against light sampling by the power heuristic.

    all_first : whether all rays come from the camera; lights that it does not see are then skipped
    """
    for row in range(SEEN_R, SEEN_B + 1, BLOCK):
        for x in range(size):
            block[row + x] = R(0)
    for j in range(lights.shape[0]):
        light = lights[j]
        if all_first and light[VISIBLE] == R(0):
            continue
        _meet_of_kind(int(light[KIND]), light, dome, size, block)

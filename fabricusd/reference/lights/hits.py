"""What rays see of the lights before their first triangle, a block of rays at a time.

A light's kind is a constant of each loop, and LLVM vectorises the loops.
"""

from __future__ import annotations

from numba import njit

from fabricusd.kernels.real import PART
from fabricusd.reference.lights.kinds import KINDS
from fabricusd.reference.lights.ray_block import BLOCK, SEEN_B, SEEN_R, R
from fabricusd.reference.lights.row import KIND, VISIBLE


def _first_of(kinds):
    """A kernel that adds a light as its kind does, see `sampling`."""
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
    """No kind is unknown: `kinds` has seen to that."""


_meet_of_kind = _first_of(list(KINDS.items()))


@njit(**PART)
def meet_lights(lights, dome, all_first, size, block):
    """Rows SEEN_R to SEEN_B of `size` rays: radiance of all lights that they pass, each weighted
    by the power heuristic against light sampling.

    all_first : whether every ray comes from the camera, so that lights it does not see are skipped
    """
    for row in range(SEEN_R, SEEN_B + 1, BLOCK):
        for x in range(size):
            block[row + x] = R(0)
    for j in range(lights.shape[0]):
        light = lights[j]
        if all_first and light[VISIBLE] == R(0):
            continue
        _meet_of_kind(int(light[KIND]), light, dome, size, block)

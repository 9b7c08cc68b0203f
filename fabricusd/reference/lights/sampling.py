"""Light sampling: chooses a light for each hit of a block and samples a direction to it.

Hits that chose the same light lie together. The light's kind and row are then constants of a loop
that LLVM vectorises.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.kernels.real import INLINE, PART, cos, sin, whole
from fabricusd.reference.lights.hit_block import (
    DISTANCE,
    LIGHT,
    LIGHT_B,
    LIGHT_G,
    LIGHT_R,
    PDF,
    TO,
    WI,
)
from fabricusd.reference.lights.kinds import KINDS
from fabricusd.reference.lights.row import CHANCE, KIND, RED
from fabricusd.reference.rays.embree import INFINITE_DISTANCE
from fabricusd.reference.rays.hit_frames import CHOSEN, MADE, NUMBERS
from fabricusd.reference.rays.wave import BLOCK, N, U, V

R = np.float32
_PI = R(math.pi)


@njit(**PART)
def choose_lights(lights, count, left, choice):
    """Write to `choice` the index of the light that each of `count` uniform numbers chooses.

    left : (count,) float32 - the uniform numbers; on return, what is left of them
    """
    for x in range(count):
        choice[x] = 0
    for j in range(lights.shape[0] - 1):
        chance = lights[j, CHANCE]
        for x in range(count):
            left[x] -= chance
            choice[x] += 0 if left[x] < R(0) else 1


def _first_of(kinds):
    """Make a kernel that calls the sampler of a light's kind.

    The kernel is a chain of comparisons built from the list of kinds: if numba called a function
    out of a table, it would lose what it knows about the arrays.
    """
    if not kinds:
        return _none
    (number, module), *others = kinds
    sampler, otherwise = module.sample, _first_of(others)

    @njit(**PART)
    def choose(kind, light, dome, begin, end, block):
        if kind == number:
            sampler(light, dome, begin, end, block)
        else:
            otherwise(kind, light, dome, begin, end, block)

    return choose


@njit(**PART)
def _none(kind, light, dome, begin, end, block):
    """The end of the chain, never reached: `kinds` makes sure that every kind has a module."""


_sample_of_kind = _first_of(list(KINDS.items()))


@njit(**PART)
def _sample(light, dome, begin, end, block):
    """Sample directions to one light for the hits from `begin` to before `end`."""
    for y in range(whole(begin), whole(end)):
        block[LIGHT_R + y], block[LIGHT_G + y] = light[RED], light[RED + 1]
        block[LIGHT_B + y] = light[RED + 2]
    _sample_of_kind(int(light[KIND]), light, dome, begin, end, block)


@njit(**PART)
def sample_lights(lights, dome, ends, count, block):
    """Fill rows WI to LIGHT_PDF of `count` hits, using two of their random numbers.

    ends : (lights,) int32 - where the hits of each light end; they are sorted by light
    """
    begin = np.int64(0)
    for j in range(lights.shape[0]):
        end = whole(ends[j])
        if end > begin:
            _sample(lights[j], dome, begin, end, block)
        begin = end
    _turn(count, block)


@njit(**INLINE)
def _turn(count, block):
    """Compute directions to the light in the surface frame, and the light's radiance over pdf."""
    for x in range(count):
        dx, dy, dz = block[TO + x], block[TO + BLOCK + x], block[TO + 2 * BLOCK + x]
        at = MADE + U * BLOCK + x
        block[WI + x] = dx * block[at] + dy * block[at + BLOCK] + dz * block[at + 2 * BLOCK]
        at = MADE + V * BLOCK + x
        block[WI + BLOCK + x] = dx * block[at] + dy * block[at + BLOCK] + dz * block[at + 2 * BLOCK]
        at = MADE + N * BLOCK + x
        block[WI + 2 * BLOCK + x] = (
            dx * block[at] + dy * block[at + BLOCK] + dz * block[at + 2 * BLOCK]
        )
        pdf = abs(block[PDF + x])
        inverse = R(1) / pdf if pdf > R(0) else R(0)
        block[LIGHT + x] *= inverse
        block[LIGHT + BLOCK + x] *= inverse
        block[LIGHT + 2 * BLOCK + x] *= inverse


@njit(**PART)
def no_lights(count, block):
    """Fill the same rows for hits that sample no light."""
    for row in range(11):
        for x in range(count):
            block[CHOSEN + row * BLOCK + x] = R(0)
    for x in range(count):
        block[WI + 2 * BLOCK + x], block[DISTANCE + x] = R(1), INFINITE_DISTANCE


@njit(**PART)
def sample_evenly(count, block):
    """Fill WI with directions uniform over the sphere, for the estimator without light sampling."""
    no_lights(count, block)
    for x in range(count):
        z = R(1) - R(2) * block[NUMBERS + 5 * BLOCK + x]
        r = math.sqrt(max(R(1) - z * z, R(0)))
        phi = R(2) * _PI * block[NUMBERS + 6 * BLOCK + x]
        block[WI + x], block[WI + BLOCK + x] = r * cos(R, phi), r * sin(R, phi)
        block[WI + 2 * BLOCK + x] = z

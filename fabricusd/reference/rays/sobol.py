"""The sampler: low-discrepancy numbers as a function of pixel, sample, place and seed alone.

Uses four dimensions of the Sobol' sequence with the direction numbers of [Joe2008], shuffled and
scrambled by Owen's nested permutations. As in [Burley2020], a hash stands in for the permutations;
the hash is that of [Pharr2023]. Each set of four numbers of each pixel is scrambled and shuffled
independently, so sets and pixels are independent and higher dimensions are padded with further
sets. There is no state: a picture does not depend on the number of workers or on their order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, types
from numba.extending import intrinsic

from fabricusd.kernels.real import INLINE
from fabricusd.reference.rays.counter import pcg4d, unit_float

_U = np.uint32

INDEX_BITS = 16
"""Bits of a sample's index. All of a pixel's 65 536 samples, the most that it may get, are
stratified together."""


class Numbers(NamedTuple):
    """The settings of the sampler.

    seed : uint32
    independent : uint32 - 0, or all ones for independent random numbers without stratification
    """

    seed: np.uint32
    independent: np.uint32


def new_numbers(seed: int, *, independent: bool = False) -> Numbers:
    """A sampler seeded by the lower 32 bits of `seed`."""
    return Numbers(np.uint32(seed & 0xFFFFFFFF), np.uint32(0xFFFFFFFF if independent else 0))


def directions(degree: int, coefficients: int, first: tuple[int, ...]) -> tuple[np.uint32, ...]:
    """Direction numbers of one dimension, bit-reversed: what each bit of an index, lowest first,
    adds (xor) to the coordinate.

    degree, coefficients, first : primitive polynomial and initial numbers of [Joe2008]; degree 0 is
        the van der Corput sequence
    """
    m = list(first) if degree else [1] * INDEX_BITS
    while len(m) < INDEX_BITS:
        value = m[-degree] ^ (m[-degree] << degree)
        for k in range(1, degree):
            if coefficients >> (degree - 1 - k) & 1:
                value ^= m[-k] << k
        m.append(value)
    whole = [f"{value << (31 - k):032b}" for k, value in enumerate(m[:INDEX_BITS])]
    return tuple(np.uint32(int(bits[::-1], 2)) for bits in whole)


_SECOND = directions(1, 0, (1,))
_THIRD = directions(2, 1, (1, 3))
_FOURTH = directions(3, 1, (1, 3, 1))


@intrinsic  # type: ignore[untyped-decorator]
def reverse_bits(_, x):
    """Reverse the bits of a uint32, by a single instruction on processors that have one."""
    return types.uint32(
        types.uint32
    ), lambda context, builder, signature, arguments: builder.bitreverse(arguments[0])


@njit(**INLINE)
def scrambled(x, seed):
    """Owen-scramble the bit-reversed `x`: the bits below each bit, and `seed`, decide its flip."""
    x = _U(x ^ _U(x * _U(0x3D20ADEA)))
    x = _U(x + seed)
    x = _U(x * ((seed >> _U(16)) | _U(1)))
    x = _U(x ^ _U(x * _U(0x05526C56)))
    return _U(x ^ _U(x * _U(0x53A22864)))


@njit(**INLINE)
def _add_bit(index, k, b, c, d):
    chosen = _U(_U(0) - ((index >> _U(k)) & _U(1)))
    return b ^ (chosen & _SECOND[k]), c ^ (chosen & _THIRD[k]), d ^ (chosen & _FOURTH[k])


@njit(**INLINE)
def _add_four_bits(index, k, b, c, d):
    # Unrolled by hand: a loop here would keep LLVM from vectorising the loop over paths around it.
    b, c, d = _add_bit(index, k, b, c, d)
    b, c, d = _add_bit(index, k + 1, b, c, d)
    b, c, d = _add_bit(index, k + 2, b, c, d)
    return _add_bit(index, k + 3, b, c, d)


@njit(**INLINE)
def sobol_reversed(index):
    """The four coordinates of a point of the unscrambled sequence, each as 32 reversed bits."""
    b, c, d = _add_four_bits(index, 0, _U(0), _U(0), _U(0))
    b, c, d = _add_four_bits(index, 4, b, c, d)
    b, c, d = _add_four_bits(index, 8, b, c, d)
    b, c, d = _add_four_bits(index, 12, b, c, d)
    return index, b, c, d


@njit(**INLINE)
def _place_in_sequence(numbers, pixel, sample, place):
    """The index of the point in the sequence, and the scrambling seeds of the four coordinates."""
    s0, s1, s2, s3 = pcg4d(pixel, place, numbers.seed, sample & numbers.independent)
    order = _U((s0 ^ (s2 >> _U(7))) * _U(0x9E3779B9) + s3)
    # Bits above INDEX_BITS would only add one more constant to the scrambling.
    index = reverse_bits(scrambled(reverse_bits(sample), order)) & _U((1 << INDEX_BITS) - 1)
    return index, s0, s1, s2, s3


@njit(**INLINE)
def third_number(numbers, pixel, sample, place):
    """The third number of `four_numbers` alone."""
    index, _, _, seed, _ = _place_in_sequence(numbers, pixel, sample, place)
    _, _, c, _ = sobol_reversed(index)
    return unit_float(reverse_bits(scrambled(c, seed)))


@njit(**INLINE)
def four_numbers(numbers, pixel, sample, place):
    """Four float32 in [0, 1), stratified over a pixel's samples for one `place` in its paths."""
    index, s0, s1, s2, s3 = _place_in_sequence(numbers, pixel, sample, place)
    a, b, c, d = sobol_reversed(index)
    return (
        unit_float(reverse_bits(scrambled(a, s0))),
        unit_float(reverse_bits(scrambled(b, s1))),
        unit_float(reverse_bits(scrambled(c, s2))),
        unit_float(reverse_bits(scrambled(d, s3))),
    )

"""Shading of cloth at level `far` with one law alone, one block of hits at a time.

A block goes through sampling and evaluation while it stays in the first-level cache.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.appearance import laws
from fabricusd.appearance.conserving.blocks import conserving_far_values
from fabricusd.appearance.conserving.levels import gap_towards
from fabricusd.appearance.published.far import far_values
from fabricusd.appearance.sampling.blocks import Drawn, sample_far, sample_far_both
from fabricusd.kernels.real import BLOCK, KERNEL, LEAN, as_part
from fabricusd.reference.rays.wave import CHANCE, F_PDF, GO, GO_PDF, KEEP, THREAD, WEIGHT, WI, WO, F

STRAIGHT = np.float32(-1)
"""The value of GO_PDF that lets a path go straight on."""


@njit(**LEAN)
def gather(hits, first, size, wo, wi):
    """Copy the directions to the viewer and to the light of `size` hits to `wo` and `wi`."""
    for row in range(3):
        to_viewer, to_light = hits[WO + row][first:], hits[WI + row][first:]
        for x in range(size):
            wo[row, x] = to_viewer[x]
        for x in range(size):
            wi[row, x] = to_light[x]


@njit(**LEAN)
def finish_far(R, hits, first, count, passes, go, towards, onwards):
    """Write values and weights; of each hit's paths, the share `passes` goes straight
    on.

    Works row by row: LLVM vectorises a loop over few rows, because it can check beforehand that
    they do not overlap.
    """
    kept, thread, f_pdf = hits[KEEP][first:], hits[THREAD][first:], hits[F_PDF][first:]
    for k in range(count):
        kept[k], thread[k] = R(1) - passes[k], R(-1)
    go_pdf, chances = hits[GO_PDF][first:], hits[CHANCE + 3][first:]
    for row in range(3):
        value, direction = hits[F + row][first:], hits[GO + row][first:]
        weight = hits[WEIGHT + row][first:]
        for k in range(count):
            value[k] = towards[row, k]
        for k in range(count):
            direction[k] = go[row, k]
        for k in range(count):
            pdf = go_pdf[k] * kept[k]
            weight[k] = onwards[row, k] / pdf if pdf > R(0) else R(0)
    for k in range(count):
        f_pdf[k] *= kept[k]
    for k in range(count):
        keep = kept[k]
        straight = chances[k] >= keep
        chances[k] = chances[k] if straight else chances[k] / keep
        go_pdf[k] = STRAIGHT if straight else go_pdf[k] * keep


_gather, _sample_far, _far_values, _finish_far = (
    as_part(kernel) for kernel in (gather, sample_far, far_values, finish_far)
)
_sample_far_both, _conserving_far_values = (
    as_part(kernel) for kernel in (sample_far_both, conserving_far_values)
)


@njit(**KERNEL)
def shade_far(R, tables, sampling, is_open, hits, first, last):
    """Fill rows F, F_PDF, GO, WEIGHT, GO_PDF, KEEP and THREAD of hits `first` to before `last`.

    is_open : 1 where light passes between the threads, 0 in opaque cloth
    """
    wo, wi = np.empty((3, BLOCK), np.float32), np.empty((3, BLOCK), np.float32)
    go, towards = np.empty((3, BLOCK), np.float32), np.empty((3, BLOCK), np.float32)
    onwards, passes = np.empty((3, BLOCK), np.float32), np.empty(BLOCK, np.float32)
    for start in range(first, last, BLOCK):
        size = min(BLOCK, last - start)
        _gather(hits, start, size, wo, wi)
        numbers = hits[CHANCE], hits[CHANCE + 1], hits[CHANCE + 2]
        drawn = Drawn(go, hits[F_PDF], hits[GO_PDF])
        _sample_far(R, sampling, wo, wi, numbers, drawn, start, size)
        _far_values(R, tables, wi, wo, towards, 0, size)
        _far_values(R, tables, go, wo, onwards, 0, size)
        for k in range(size):
            passes[k] = is_open * laws.openness(R, tables, wo[0, k], wo[1, k], wo[2, k])
        _finish_far(R, hits, start, size, passes, go, towards, onwards)


@njit(**KERNEL)
def shade_far_conserving(R, tables, sampling, front, is_open, hits, first, last):
    """`shade_far` with the conserving law; front : its tables of the cloth's front, for the gaps"""
    wo, wi = np.empty((3, BLOCK), np.float32), np.empty((3, BLOCK), np.float32)
    go, towards = np.empty((3, BLOCK), np.float32), np.empty((3, BLOCK), np.float32)
    onwards, passes = np.empty((3, BLOCK), np.float32), np.empty(BLOCK, np.float32)
    for start in range(first, last, BLOCK):
        size = min(BLOCK, last - start)
        _gather(hits, start, size, wo, wi)
        numbers = hits[CHANCE], hits[CHANCE + 1], hits[CHANCE + 2]
        drawn = Drawn(go, hits[F_PDF], hits[GO_PDF])
        _sample_far_both(R, sampling, wo, wi, numbers, drawn, start, size)
        _conserving_far_values(R, tables, wi, wo, towards, 0, size)
        _conserving_far_values(R, tables, go, wo, onwards, 0, size)
        for k in range(size):
            passes[k] = is_open * gap_towards(R, front, wo[0, k], wo[1, k], wo[2, k])
        _finish_far(R, hits, start, size, passes, go, towards, onwards)

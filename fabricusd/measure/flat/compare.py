"""How near the recovered cloth comes to its photograph, beside two pictures that are no fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.measure.flat.fit import Flat
from fabricusd.measure.flat.lattice import Lattice
from fabricusd.measure.flat.photograph import Photograph
from fabricusd.measure.flat.scene import photograph_of, scene_of
from fabricusd.measure.flat.setup import Setup
from fabricusd.quality.pictures import difference, flip_map

Floats = NDArray[np.float64]

TILE_REPEATS = 8
"""Repeats of the weave in a tile of the photograph, each way."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """render : (h, w, 3) by the path tracer; flip : (h, w); delta_e : mean of CIE 2000
    figures : FLIP of the render, of a constant colour and of the photograph's tile relit
    """

    render: Floats
    flip: Floats
    delta_e: float
    figures: dict[str, float]


def rendered(flat: Flat, *, behind: bool = False, spp: int = 32) -> Floats:
    """(h, w, 3) the recovered cloth under the stated light, by the path tracer."""
    scene = scene_of(
        flat.fabric, flat.setup, flat.front.shape, pitch=flat.lattice.pitch,
        turn=flat.lattice.turn, gain=flat.gain, behind=behind,
    )  # fmt: skip
    return photograph_of(scene, flat.front.shape, spp=spp)


def constant(photograph: Photograph) -> Floats:
    """(h, w, 3) the photograph's mean."""
    mean = photograph.linear.mean(axis=(0, 1))
    return np.array(np.broadcast_to(mean, photograph.linear.shape))


def tile_relit(photograph: Photograph, lattice: Lattice, setup: Setup) -> Floats:
    """(h, w, 3) a tile from the photograph's middle, repeated, under the stated lamp as if it were
    matte."""
    h, w = photograph.shape
    weave, (ends, picks) = lattice.weave, lattice.pitch
    high = min(max(round(picks * weave.picks * TILE_REPEATS), 1), h)
    wide = min(max(round(ends * weave.ends * TILE_REPEATS), 1), w)
    top, left = (h - high) // 2, (w - wide) // 2
    tile = photograph.linear[top : top + high, left : left + wide]
    laid = np.tile(tile, (h // high + 2, w // wide + 2, 1))[:h, :w]
    wi, _, square = setup.pairs(setup.places(photograph.shape))
    light = (wi[:, 2] / square).reshape(h, w, 1)
    return np.asarray(laid * light / light[h // 2, w // 2])


def flip(picture: Floats, photograph: Photograph) -> Floats:
    """(h, w) FLIP of what a display shows."""
    shown = np.clip(picture, 0.0, 1.0).astype(np.float32)
    return flip_map(shown, photograph.linear.astype(np.float32), high_range=False)


def compare(flat: Flat, *, spp: int = 32) -> Comparison:
    """Render the fabric and compare."""
    picture = rendered(flat, spp=spp)
    own = flip(picture, flat.front)
    told = difference(
        np.clip(picture, 0.0, 1.0).astype(np.float32), flat.front.linear.astype(np.float32),
        high_range=False,
    )  # fmt: skip
    others = {
        "constant colour": constant(flat.front),
        "its own tile, relit": tile_relit(flat.front, flat.lattice, flat.setup),
    }
    figures = {"render": float(own.mean())}
    figures |= {name: float(flip(p, flat.front).mean()) for name, p in others.items()}
    return Comparison(render=picture, flip=own, delta_e=told.delta_e_mean, figures=figures)


def rendered_through(flat: Flat, *, spp: int = 32) -> Floats:
    """(h, w, 3) the cloth lit from behind, made as bright as its photograph: the power of that lamp
    is not known."""
    assert flat.behind is not None
    picture = rendered(flat, behind=True, spp=spp)
    return as_bright(picture, flat.behind.linear)


def as_bright(picture: Floats, photograph: Floats) -> Floats:
    """(h, w, 3) `picture` times a number that makes most of it as bright as the photograph: by the
    median over pixels, which specks of the lamp itself do not change, of the mean over channels,
    some of which may be black."""
    own, wanted = (float(np.median(p.mean(axis=2))) for p in (picture, photograph))
    return np.asarray(picture * (wanted / max(own, 1e-12)))

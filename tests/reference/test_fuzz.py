"""The path tracer lays fuzz over cloth as `surface.evaluate` does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance.fuzz import bald
from fabricusd.appearance.surface import evaluate
from fabricusd.fabric import even
from fabricusd.scene.light_kinds import DOME
from fabricusd.scene.scene import Camera, Light
from fabricusd.schema import load
from tests.appearance.test_fuzz import hairy
from tests.reference.scenes import cloth, grid, looking, picture

WHITE_DOME = Light(path="dome", kind=DOME, radiance=(1.0, 1.0, 1.0))

EYE = np.array((1.0, 0.5, 1.0)) / 1.5
"""70 degrees from the normal, at 45 to weft and warp: whichever axis is which, it is the same."""


def dark(hairiness):
    fabric = even(hairy(load("cotton_poplin"), hairiness))
    threads = {n: replace(t, albedo=(0.3, 0.5, 0.7)) for n, t in fabric.threads.items()}
    return replace(fabric, threads=threads)


def under_a_dome(fabric, **settings):
    """(mean, its standard error), (3,) each, of cloth that is seen from EYE."""
    camera = Camera(frame=looking(tuple(2 * EYE)), orthographic=True, aperture=(0.1, 0.1))
    r = picture([grid()], [cloth(fabric, threads=120.0)], [WHITE_DOME], camera, spp=256,
                shadow="none", **settings)  # fmt: skip
    beauty = r.layers["beauty"][..., :3]
    count = 256 * beauty.shape[0] * beauty.shape[1]
    return beauty.mean(axis=(0, 1)), np.sqrt(r.layers["variance"].mean(axis=(0, 1)) / count)


def by_the_law(fabric):
    """(3,) what EYE receives from above and from behind, gaps left out."""
    x, w = np.polynomial.legendre.leggauss(48)
    phi = (np.arange(96) + 0.5) * (2 * np.pi / 96)
    z, turn = (a.ravel() for a in np.meshgrid(x, phi, indexing="ij"))
    flat = np.sqrt(1 - z * z)
    wi = np.stack((flat * np.cos(turn), flat * np.sin(turn), z), axis=-1)
    wo = EYE[[0, 2, 1]]
    return (np.repeat(w, 96) * (2 * np.pi / 96)) @ evaluate(fabric, wi, wo)


@pytest.mark.parametrize("estimator", ["light", "surface"])
@pytest.mark.parametrize("level", ["far", "thread"])
def test_a_picture_changes_by_what_the_fuzz_adds(level, estimator):
    fabric = dark(8.0)
    settings = {"level": level, "estimator": estimator}
    (found, error), (bare, other) = (under_a_dome(f, **settings) for f in (fabric, bald(fabric)))
    expected = by_the_law(fabric) - by_the_law(bald(fabric))
    tolerance = 4.5 * np.hypot(error, other) + 2e-3
    assert (np.abs(found - bare - expected) < tolerance).all()
    # That the comparison can fail: fuzz changes the picture by much more.
    assert (np.abs(expected) > 2 * tolerance).any()

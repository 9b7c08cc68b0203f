"""Pictures against what they were; `python -m tests.reference.goldens` makes those anew."""

from __future__ import annotations

import pytest

from fabricusd.images.files import read_exr_layers
from fabricusd.quality.statistics import z_test
from tests.reference.goldens import CASES, FOLDER, SAMPLES, SIZE, render_case
from tests.reference.scenes import blocks

ERROR_RATE = 1e-4
"""Chance that a sound picture fails, over all of them."""


def against_golden(name, spp=1024, **settings):
    layers, _ = read_exr_layers(FOLDER / f"{name}.exr")
    now = render_case(name, spp=spp, seed=2, **settings).layers
    return z_test(*_pooled(now), *_pooled(layers), significance=ERROR_RATE / len(CASES))


def _pooled(layers):
    """Mean and its variance over squares of 4 x 4 pixels: single ones have too long tails for z."""
    mean, variance = (blocks(layers[k][..., :3], SIZE // 4) for k in ("beauty", "variance"))
    return mean, variance / 16


@pytest.mark.parametrize("name", CASES)
def test_a_picture_is_its_golden_but_for_chance(name):
    good, smallest = against_golden(name)
    assert good, f"p {smallest:.2g}; if the change is wanted: python -m tests.reference.goldens"


def test_golden_pictures_would_see_a_lamp_five_per_cent_brighter():
    assert not against_golden("satin_far", brightness=1.05)[0]


@pytest.mark.parametrize(
    "name", ["silk_ball", pytest.param("linen_skirt", marks=pytest.mark.exhaustive)]
)
def test_golden_pictures_would_see_facets_where_normals_are_smooth(name):
    # The skirt shows as much of its inside as of its outside: a quarter of the samples miss this.
    assert not against_golden(name, spp=4 * SAMPLES, smooth=False)[0]
